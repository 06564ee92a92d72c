"""The PWM unit (PWMMR0 ... PWMMR6, PWMLER): match values take effect at the start of a PWM period.

At 60 MHz and MR0 = 600 a period is 10 us (100 kHz); channel n is high for MRn of MR0 counts. Every latch that
touches MR0, MR2 or MR6 (the two leads of an H-bridge) is told outside as PWM_UPDATE, stamped with the start
of the period that first has the new values: at most one period after `now`.
"""

import cython

from firmware_sim.microcontroller import Peripheral
from foundation.user_error import UserError


class Pwm(Peripheral):
    """Seven match registers; `latched_MRn` are the values that drive the pins. `period`: MR0 in counts."""

    def __init__(self, chip, period=600, hz=0, phase_ns=0) -> None:
        Peripheral.__init__(self, chip)
        self.hz = hz if hz else chip.hz
        if period <= 0:
            raise UserError(f"{chip.name}: PWM: period {period} counts must be above 0")
        self.MR0 = period
        self.MR1 = 0
        self.MR2 = 0
        self.MR3 = 0
        self.MR4 = 0
        self.MR5 = 0
        self.MR6 = 0
        self.LER = 0
        self.latched_MR0 = period
        self.latched_MR1 = 0
        self.latched_MR2 = 0
        self.latched_MR3 = 0
        self.latched_MR4 = 0
        self.latched_MR5 = 0
        self.latched_MR6 = 0
        self.phase_ns = phase_ns
        self.latch_time = phase_ns
        self.updates = 0

    def write(self, MR2: cython.longlong = -1, MR6: cython.longlong = -1) -> cython.void:
        """Write the two bridge leads (counts; -1 leaves one as it is) and enable their latches."""
        if MR2 >= 0:
            self.MR2 = MR2
        if MR6 >= 0:
            self.MR6 = MR6
        self.latch((1 << 2) | (1 << 6))

    def latch(self, mask: cython.longlong) -> None:
        """Write PWMLER: the match values whose bits are set take effect at the next period."""
        self.LER = mask
        self.latch_time = self.next_period()
        if mask & 1:
            self.latched_MR0 = self.MR0
        if mask & 2:
            self.latched_MR1 = self.MR1
        if mask & 4:
            self.latched_MR2 = self.MR2
        if mask & 8:
            self.latched_MR3 = self.MR3
        if mask & 16:
            self.latched_MR4 = self.MR4
        if mask & 32:
            self.latched_MR5 = self.MR5
        if mask & 64:
            self.latched_MR6 = self.MR6
        if mask & 69:  # MR0, MR2 or MR6
            self.updates += 1
            self.chip.outbox.push(
                self.latch_time, 0, 35, self.latched_MR2, self.latched_MR6, self.latched_MR0
            )  # PWM_UPDATE

    def next_period(self) -> cython.longlong:
        """Start (ns) of the first PWM period that begins at `now` or later."""
        # ROBOT PARITY: periods are counted from phase_ns with the present MR0; on the chip a changed MR0
        # shifts the later periods instead. MR0 is constant on boards that drive a bridge.
        local: cython.longlong = self.chip.crystal.local_ns(self.chip.now - self.phase_ns)
        period: cython.longlong = self.latched_MR0 * 1000000000 // self.hz
        n: cython.longlong = -(-local // period)
        return self.chip.crystal.tick_time_ns(n, period, self.phase_ns)
