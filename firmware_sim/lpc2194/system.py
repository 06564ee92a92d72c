"""The system control block: PLL, VPB divider, flash accelerator, power, external interrupts.

LPC2194 user manual, System Control Block. The PLL is locked `LOCK_NS` after it was enabled. Not modelled: vectors in
RAM (MEMMAP), power-down. PCONP switches nothing off.
"""

from typing import Final

import cython

from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.lpc2194.vic import EINT0_INPUT
from ranger_sim.firmware_sim.peripherals.adc_external import Ads7871

EINTS: Final = 4

LOCK_NS = 100_000  # chosen by us: the user manual only says that a program has to wait for PLOCK
PLLCON_ENABLED, PLLCON_CONNECTED = 1, 2
PLOCK = 0x400
FEEDS = (0xAA, 0x55)
DIVIDERS = {0: 4, 1: 1, 2: 2}  # by VPBDIV
MAM_SLOWEST = 7


@cython.final
@cython.cclass
class SystemBlock(Block):
    """`EXTINT`: flags of the four external interrupts. `converter`: the one whose BUSY drives one of them, or None."""

    converter: Ads7871
    EXTINT: cython.longlong
    EXTMODE: cython.longlong
    EXTPOLAR: cython.longlong
    levels: cython.longlong[4]
    plain: dict
    MAMCR: cython.longlong
    MAMTIM: cython.longlong
    feed: cython.longlong
    lock_ns: cython.longlong
    active: tuple

    REGISTERS = {
        0x000: ("MAMCR", "rw"),
        0x004: ("MAMTIM", "rw"),
        0x040: ("MEMMAP", "rw"),
        0x080: ("PLLCON", "rw"),
        0x084: ("PLLCFG", "rw"),
        0x088: ("PLLSTAT", "r"),
        0x08C: ("PLLFEED", "w"),
        0x0C0: ("PCON", "rw"),
        0x0C4: ("PCONP", "rw"),
        0x100: ("VPBDIV", "rw"),
        0x140: ("EXTINT", "rw"),
        0x144: ("EXTWAKE", "rw"),
        0x148: ("EXTMODE", "rw"),
        0x14C: ("EXTPOLAR", "rw"),
        0x180: ("RSIR", "rw"),
        0x1A0: ("SCS", "rw"),
    }

    def __init__(self, chip, clocks, converter) -> None:
        Block.__init__(self, chip, clocks, "system control", 0xE01FC000, 15 << EINT0_INPUT)
        self.converter = converter
        self.levels = [0] * 4
        self.EXTINT = 0
        self.EXTMODE = 0
        self.EXTPOLAR = 0
        # registers that keep what is written: after reset
        self.plain = {0x040: 1, 0x080: 0, 0x084: 0, 0x0C4: 0x3BE, 0x100: 0, 0x144: 0, 0x180: 1, 0x1A0: 0}
        self.MAMCR = 0
        self.MAMTIM = MAM_SLOWEST
        self.feed = 0
        self.active = (0, 0)  # PLLCON and PLLCFG as they were fed
        self.lock_ns = 0

    # --- external interrupts ------------------------------------------------------------------------------

    def on_pin(self, number: cython.longlong, level: cython.longlong, time: cython.longlong) -> cython.longlong:
        """Take the present level of the pin of external interrupt `number`."""
        flag: cython.longlong = 1
        flag <<= number
        rising: cython.longlong = self.EXTPOLAR >> number & 1
        if self.EXTMODE >> number & 1:
            if level != self.levels[number] and level == rising:
                self.EXTINT |= flag
        elif level == rising:
            self.EXTINT |= flag
        self.levels[number] = level
        return 0

    def requests(self) -> cython.longlong:
        converter: Ads7871 = self.converter
        if converter is not None and converter.busy != self.levels[converter.eint]:
            self.on_pin(converter.eint, converter.busy, self.chip.now)
        return self.EXTINT << EINT0_INPUT

    @cython.cfunc
    def _clear(self, flags: cython.longlong) -> cython.void:
        """Write EXTINT: the flag of a pin that is at its active level stays."""
        number: cython.longlong
        for number in range(EINTS):
            if flags >> number & 1:
                if self.EXTMODE >> number & 1 or self.levels[number] != self.EXTPOLAR >> number & 1:
                    self.EXTINT &= ~((flags >> number & 1) << number)

    # --- clocks -------------------------------------------------------------------------------------------

    @cython.ccall
    def _feed(self, value) -> object:
        """Write PLLFEED: 0xAA, then 0x55, take PLLCON and PLLCFG over."""
        if value == FEEDS[0]:
            self.feed = 1
            return
        if value == FEEDS[1] and self.feed:
            before = self.active
            self.active = (self.plain[0x080], self.plain[0x084])
            if self.active[0] & PLLCON_ENABLED and (not before[0] & PLLCON_ENABLED or before[1] != self.active[1]):
                self.lock_ns = self.chip.now + LOCK_NS
            self._set_clock()
        self.feed = 0

    @cython.ccall
    def _set_clock(self) -> object:
        """The processor's clock by the PLL, the peripherals' by VPBDIV."""
        control, configuration = self.active
        both = PLLCON_ENABLED | PLLCON_CONNECTED
        connected = control & both == both and self.chip.now >= self.lock_ns
        factor = (configuration & 31) + 1 if connected else 1
        self.chip.set_clocks(self.clocks.crystal_hz * factor, DIVIDERS.get(self.plain[0x100] & 3, 4))

    # --- registers ----------------------------------------------------------------------------------------

    def read(self, offset: cython.longlong) -> cython.longlong:
        if offset == 0x088:
            control, configuration = self.active
            locked = control & PLLCON_ENABLED and self.chip.now >= self.lock_ns
            return configuration & 0x7F | (control & 3) << 8 | (PLOCK if locked else 0)
        self.steady = True
        if offset == 0x140:
            return self.EXTINT
        if offset == 0x148:
            return self.EXTMODE
        if offset == 0x14C:
            return self.EXTPOLAR
        if offset == 0x000:
            return self.MAMCR
        if offset == 0x004:
            return self.MAMTIM
        if offset == 0x0C0:
            return 0
        value = self.plain.get(offset)
        return self.unknown(offset, False) if value is None else value

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        if offset == 0x140:
            self._clear(value & 15)
        elif offset == 0x148:
            self.EXTMODE = value & 15
        elif offset == 0x14C:
            self.EXTPOLAR = value & 15
        elif offset == 0x000 or offset == 0x004:
            self._accelerate(offset, value)
        elif offset == 0x08C:
            self._feed(value & 0xFF)
        elif offset == 0x0C0:
            if value & 2:
                self.not_modelled("power-down mode (PCON)")
            if value & 1:
                self.chip.sleep()
        elif offset == 0x040:
            if value & 3 != 1:
                self.not_modelled(f"MEMMAP {value & 3}: vectors elsewhere than in flash")
        elif offset in self.plain:
            self.plain[offset] = value
            if offset == 0x100:
                self._set_clock()
        else:
            self.unknown(offset, True)
        return 0

    @cython.ccall
    def _accelerate(self, offset, value) -> object:
        """MAMCR or MAMTIM."""
        if offset:
            self.MAMTIM = value & 7 or MAM_SLOWEST
        else:
            self.MAMCR = value & 3
        self.chip.core.set_mam(min(self.MAMCR, 2), self.MAMTIM)
