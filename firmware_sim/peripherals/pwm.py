# cython: cdivision=True
# (what is divided is never below 0)
"""The PWM unit (PWMMR0 ... PWMMR6, PWMLER): match values take effect at the start of a PWM period.

At 60 MHz and MR0 = 600 a period is 10 us (100 kHz); channel n is high for MRn of MR0 counts. Every latch that
touches MR0, MR2 or MR6 (the two leads of an H-bridge) is told outside as PWM_UPDATE, stamped with the start
of the period that first has the new values: at most one period after `now`.
"""

from typing import Final

import cython

from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.foundation.events import PWM_UPDATE
from ranger_sim.foundation.user_error import FirmwareError

# PWMLER, latch enable
LER_MR0: Final = 0x1
LER_MR1: Final = 0x2
LER_MR2: Final = 0x4
LER_MR3: Final = 0x8
LER_MR4: Final = 0x10
LER_MR5: Final = 0x20
LER_MR6: Final = 0x40

LONGEST_PERIOD_S = 2  # so that products of times and rates stay within 64 bits


@cython.final
@cython.cclass
class Pwm(Peripheral):
    """Seven match registers; `latched_MRn` are the values that drive the pins. `period`: MR0 in counts.

    `period_start`: time (ns) of the period that has what was latched last. `driven`: the channels whose pins it
    drives, bit n for channel n.
    """

    # what a new duty touches
    MR2: cython.longlong
    MR6: cython.longlong
    period_start: cython.longlong
    rest: cython.longlong
    rate: cython.longlong
    period_ns: cython.longlong
    LER: cython.longlong
    driven: cython.longlong
    latched_MR0: cython.longlong
    latched_MR2: cython.longlong
    latched_MR6: cython.longlong
    # the rest
    MR0: cython.longlong
    MR1: cython.longlong
    MR3: cython.longlong
    MR4: cython.longlong
    MR5: cython.longlong
    hz: cython.longlong
    phase_ns: cython.longlong
    latched_MR1: cython.longlong
    latched_MR3: cython.longlong
    latched_MR4: cython.longlong
    latched_MR5: cython.longlong

    def __init__(self, chip, period=600, hz=0, phase_ns=0) -> None:
        Peripheral.__init__(self, chip)
        self.hz = hz if hz else chip.hz
        self.MR0 = period
        self.MR1 = 0
        self.MR2 = 0
        self.MR3 = 0
        self.MR4 = 0
        self.MR5 = 0
        self.MR6 = 0
        self.LER = 0
        self.driven = 0x7E
        self.latched_MR0 = period
        self.latched_MR1 = 0
        self.latched_MR2 = 0
        self.latched_MR3 = 0
        self.latched_MR4 = 0
        self.latched_MR5 = 0
        self.latched_MR6 = 0
        self.phase_ns = phase_ns
        self.rate = 1_000_000_000 + chip.crystal.ppb  # ns that the chip's clock counts in a true second
        self.period_ns = 0  # on the chip's clock
        self.period_start = phase_ns
        self.rest = 0  # what `period_start` was rounded down by, in 1/rate ns
        self._count_periods()

    def retune(self, now, before) -> None:
        """The period that was found last stays; those behind it are longer or shorter."""
        self.rate = 1_000_000_000 + self.chip.crystal.ppb
        self.rest = 0

    @cython.ccall
    def write(self, MR2: cython.longlong, MR6: cython.longlong) -> None:
        """Write the two bridge leads (counts) and enable their latches."""
        self.MR2 = MR2
        self.MR6 = MR6
        self.LER = LER_MR2 | LER_MR6
        self._find_period()
        self.latched_MR2 = MR2
        self.latched_MR6 = MR6
        self.chip.outbox.push(self.period_start, 0, PWM_UPDATE, MR2, MR6, self.latched_MR0)

    @cython.ccall
    def latch(self, mask: cython.longlong) -> None:
        """Write PWMLER: the match values whose bits are set take effect at the next period."""
        self.LER = mask
        self._find_period()
        if mask & LER_MR0:
            self.latched_MR0 = self.MR0
        if mask & LER_MR1:
            self.latched_MR1 = self.MR1
        if mask & LER_MR2:
            self.latched_MR2 = self.MR2
        if mask & LER_MR3:
            self.latched_MR3 = self.MR3
        if mask & LER_MR4:
            self.latched_MR4 = self.MR4
        if mask & LER_MR5:
            self.latched_MR5 = self.MR5
        if mask & LER_MR6:
            self.latched_MR6 = self.MR6
        if mask & (LER_MR0 | LER_MR2 | LER_MR6):
            self.chip.outbox.push(
                self.period_start, 0, PWM_UPDATE, self.latched_MR2, self.latched_MR6, self.latched_MR0
            )
        if mask & LER_MR0:
            self._count_periods()
        self.tell()

    @cython.ccall
    def tell(self) -> None:
        """Pass the latched values to the follower of the unit's pins on the board (`Chip.pwm_follower`).

        ROBOT PARITY: at once, where the pins have it from the next period on; and not what `write` does to a bridge.
        """
        if self.chip.pwm_follower is not None:
            cython.cast(Peripheral, self.chip.pwm_follower).on_pwm(self)

    @cython.cfunc
    def _count_periods(self) -> None:
        """Count periods of MR0 from `phase_ns` on."""
        # ROBOT PARITY: on the chip a changed MR0 shifts the later periods instead of counting them anew. MR0 is
        # constant on boards that drive a bridge.
        if not 0 < self.latched_MR0 <= LONGEST_PERIOD_S * self.hz:
            raise FirmwareError(
                f"{self.chip.name}: PWM: period {self.latched_MR0} counts must be above 0"
                f" and at most {LONGEST_PERIOD_S * self.hz}"
            )
        self.period_ns = self.latched_MR0 * 1_000_000_000 // self.hz
        self.period_start = self.phase_ns
        self.rest = 0

    @cython.cfunc
    def _find_period(self) -> cython.void:
        """Go on to the first period that begins at `now` or later: exactly to its `Crystal.tick_time_ns`."""
        since: cython.longlong = self.chip.now - self.period_start
        periods: cython.longlong
        while since > 2000000000:  # LONGEST_PERIOD_S
            since -= self._go_on(2000000000 // self.period_ns)
        if since > 0:
            periods = (since * self.rate - self.rest) // 1000000000
            self._go_on((periods + self.period_ns - 1) // self.period_ns)

    @cython.cfunc
    @cython.exceptval(check=False)
    def _go_on(self, periods: cython.longlong) -> cython.longlong:
        """Go on by `periods`; returns how long they take (ns)."""
        parts: cython.longlong = self.rest + periods * self.period_ns * 1000000000
        whole: cython.longlong = parts // self.rate
        self.rest = parts - whole * self.rate
        self.period_start += whole
        return whole
