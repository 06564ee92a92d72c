"""The PWM unit's registers: PWMTCR, PWMMR0 ... 6, PWMPCR, PWMLER.

LPC2194 user manual, Pulse Width Modulator. Match values take effect with PWMLER at the start of a period while PWM mode
is on, at once while it is off. Not modelled: prescaler, double edges, its interrupts, and matches that stop it.
The unit is peripherals/pwm.py.
"""

from typing import Final

import cython

from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.peripherals.pwm import Pwm

TCR_COUNTS: Final = 1
TCR_PWM: Final = 8
MCR_RESET_MR0: Final = 2

MATCHES = ("MR0", "MR1", "MR2", "MR3", "MR4", "MR5", "MR6")
MATCH_OFFSETS = (0x18, 0x1C, 0x20, 0x24, 0x40, 0x44, 0x48)


@cython.final
@cython.cclass
class PwmBlock(Block):
    """`begun`: periods pass. They begin when the unit counts in PWM mode and MR0 ends its periods."""

    pwm: Pwm
    TCR: cython.longlong
    MCR: cython.longlong
    PCR: cython.longlong
    begun: cython.bint

    REGISTERS = {
        0x00: ("PWMIR", "rw"),
        0x04: ("PWMTCR", "rw"),
        0x08: ("PWMTC", "r"),
        0x0C: ("PWMPR", "rw"),
        0x14: ("PWMMCR", "rw"),
        **{offset: (f"PWM{name}", "rw") for offset, name in zip(MATCH_OFFSETS, MATCHES, strict=True)},
        0x4C: ("PWMPCR", "rw"),
        0x50: ("PWMLER", "rw"),
    }

    def __init__(self, chip, clocks) -> None:
        Block.__init__(self, chip, clocks, "PWM", 0xE0014000)
        self.pwm = Pwm(chip, period=600, hz=60_000_000)  # until the program sets it up
        self.pwm.MR0 = 0
        self.pwm.driven = 0
        self.TCR = 0
        self.MCR = 0
        self.PCR = 0
        self.begun = False

    def clocked(self) -> None:
        self.begun = False
        self._start_or_stop()

    @cython.ccall
    def _start_or_stop(self) -> object:
        """Begin or stop the periods, as the registers require."""
        pwm: Pwm = self.pwm
        runs: cython.bint = self.TCR & 0xB == TCR_COUNTS | TCR_PWM and self.MCR & MCR_RESET_MR0 and pwm.MR0 > 0
        counted: cython.bint = self.begun
        self.begun = runs
        self._drive()
        if counted or not runs:
            return
        pwm.hz = self.clocks.pclk
        pwm.phase_ns = self.chip.now
        pwm.rate = 1_000_000_000 + self.chip.crystal.ppb
        pwm.period_start = self.chip.now
        pwm.latch(0x7F)
        pwm.LER = 0

    @cython.ccall
    def _drive(self) -> object:
        """Drive pulses at the pins of the channels that PWMPCR enables, while periods pass."""
        self.pwm.driven = self.PCR >> 8 & 0x7E if self.begun else 0
        self.pwm.notify_follower()

    @cython.cfunc
    @cython.exceptval(check=False)
    def _match(self, number: cython.longlong) -> cython.longlong:
        pwm: Pwm = self.pwm
        if number == 2:
            return pwm.MR2
        if number == 6:
            return pwm.MR6
        if number == 0:
            return pwm.MR0
        if number == 1:
            return pwm.MR1
        if number == 3:
            return pwm.MR3
        return pwm.MR4 if number == 4 else pwm.MR5

    def read(self, offset: cython.longlong) -> cython.longlong:
        pwm: Pwm = self.pwm
        since: cython.longlong
        if offset == 0x08:
            if not self.begun:
                return 0
            since = self.chip.crystal.ns_to_cycles(self.chip.now - pwm.phase_ns, pwm.hz)
            return since % pwm.latched_MR0
        self.steady = True
        if 0x18 <= offset <= 0x24:
            return self._match((offset - 0x18) >> 2)
        if 0x40 <= offset <= 0x48:
            return self._match(4 + ((offset - 0x40) >> 2))
        if offset == 0x50:
            return pwm.LER
        if offset == 0x04:
            return self.TCR
        if offset == 0x14:
            return self.MCR
        if offset == 0x4C:
            return self.PCR
        if offset == 0x00 or offset == 0x0C:
            return 0
        return self.unknown(offset, False)

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        pwm: Pwm = self.pwm
        number: cython.longlong = -1
        if 0x18 <= offset <= 0x24:
            number = (offset - 0x18) >> 2
        elif 0x40 <= offset <= 0x48:
            number = 4 + ((offset - 0x40) >> 2)
        if number == 2:
            pwm.MR2 = value
        elif number == 6:
            pwm.MR6 = value
        elif number == 0:
            pwm.MR0 = value
            if not self.begun:
                self._start_or_stop()
        elif number == 1:
            pwm.MR1 = value
        elif number == 3:
            pwm.MR3 = value
        elif number == 4:
            pwm.MR4 = value
        elif number == 5:
            pwm.MR5 = value
        elif offset == 0x50:
            if self.begun and value & 0x7F:
                if value & 1 and pwm.MR0 <= 0:
                    self.not_modelled("PWM with a period of 0 counts (PWMMR0)")
                pwm.latch(value & 0x7F)
                pwm.LER = 0  # the values hold from the next period on, which no program waits for
        elif offset == 0x04:
            self.TCR = value & 0xB
            self._start_or_stop()
        elif offset == 0x14:
            if value & ~MCR_RESET_MR0:
                self.not_modelled("PWM interrupts, and matches that stop it (PWMMCR)")
            self.MCR = value
            self._start_or_stop()
        elif offset == 0x4C:
            if value & 0x7E:
                self.not_modelled("PWM with double edges (PWMPCR)")
            self.PCR = value
            self._drive()
        elif offset == 0x0C:
            if value:
                self.not_modelled("the PWM's prescaler (PWMPR)")
        elif offset != 0x00:
            self.unknown(offset, True)
        return 0
