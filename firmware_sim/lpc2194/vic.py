"""The vectored interrupt controller's registers: 32 inputs that are levels, FIQ, 16 vectored slots, software inputs.

LPC2194 user manual, VIC (an ARM PL190). A read of VICVectAddr begins the service of the slot it names: until the write
to VICVectAddr ends it, only slots before it reach the processor. Protection is not modelled: user mode reaches all.
"""

from typing import Final

import cython

from ranger_sim.firmware_sim.arm7.core import FIQ_LINE, IRQ_LINE
from ranger_sim.firmware_sim.lpc2194.block import Block

# inputs, LPC2194 user manual
TIMER0_INPUT: Final = 4
TIMER1_INPUT: Final = 5
UART0_INPUT: Final = 6
UART1_INPUT: Final = 7
SPI0_INPUT: Final = 10
SSP_INPUT: Final = 11
EINT0_INPUT: Final = 14
ADC_INPUT: Final = 18
CAN_INPUT: Final = 19
CAN1_TX_INPUT: Final = 20
CAN1_RX_INPUT: Final = 26

SLOTS: Final = 16
NO_SLOT: Final = 16  # an input without a slot: VICDefVectAddr
IDLE: Final = 17  # before every slot: nothing is served

SLOT_ENABLED = 0x20  # VICVectCntl
NAMES = {
    0x000: ("VICIRQStatus", "r"),
    0x004: ("VICFIQStatus", "r"),
    0x008: ("VICRawIntr", "r"),
    0x00C: ("VICIntSelect", "rw"),
    0x010: ("VICIntEnable", "rw"),
    0x014: ("VICIntEnClr", "w"),
    0x018: ("VICSoftInt", "rw"),
    0x01C: ("VICSoftIntClear", "w"),
    0x020: ("VICProtection", "rw"),
    0x030: ("VICVectAddr", "rw"),
    0x034: ("VICDefVectAddr", "rw"),
    **{0x100 + 4 * slot: (f"VICVectAddr{slot}", "rw") for slot in range(16)},
    **{0x200 + 4 * slot: (f"VICVectCntl{slot}", "rw") for slot in range(16)},
}


@cython.final
@cython.cclass
class VicBlock(Block):
    """`raw`: levels of the 32 inputs, without the software's; `lines` what the processor sees (IRQ_LINE, FIQ_LINE)."""

    raw: cython.longlong
    soft: cython.longlong
    enabled: cython.longlong
    selected: cython.longlong
    lines: cython.longlong
    serving: cython.longlong
    depth: cython.longlong
    protection: cython.longlong
    default_address: cython.longlong
    addresses: cython.longlong[16]
    controls: cython.longlong[16]
    slot_of: cython.longlong[32]
    served: cython.longlong[18]

    READ_ACTS = frozenset({0x30})
    REGISTERS = dict(NAMES)

    def __init__(self, chip, clocks) -> None:
        Block.__init__(self, chip, clocks, "VIC", 0xFFFFF000)
        self.raw = 0
        self.soft = 0
        self.enabled = 0
        self.selected = 0
        self.protection = 0
        self.default_address = 0
        self.addresses = [0] * 16
        self.controls = [0] * 16
        self.slot_of = [16] * 32  # NO_SLOT; by input
        self.lines = 0
        self.serving = 17  # IDLE: the slot that is being served
        self.served = [0] * 18  # those that it has interrupted
        self.depth = 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def settle(self) -> cython.longlong:
        """Set the processor's inputs from the present levels."""
        active: cython.longlong = (self.raw | self.soft) & self.enabled
        irq: cython.longlong = active & ~self.selected
        self.lines = FIQ_LINE if active & self.selected else 0
        if irq and (self.serving == IDLE or self.first(irq) < self.serving):
            self.lines |= IRQ_LINE
        return self.lines

    @cython.cfunc
    @cython.exceptval(check=False)
    @cython.boundscheck(False)
    @cython.wraparound(False)
    def first(self, irq: cython.longlong) -> cython.longlong:
        """The first slot of the inputs in `irq`; NO_SLOT when only inputs without one ask."""
        number: cython.longlong
        best: cython.longlong = NO_SLOT
        for number in range(32):
            if irq >> number & 1 and self.slot_of[number] < best:
                best = self.slot_of[number]
        return best

    @cython.cfunc
    @cython.exceptval(check=False)
    @cython.boundscheck(False)
    @cython.wraparound(False)
    def begin(self) -> cython.longlong:
        """Read VICVectAddr: the address of the first handler asked for, whose service begins."""
        irq: cython.longlong = (self.raw | self.soft) & self.enabled & ~self.selected
        slot: cython.longlong
        if irq == 0:
            return self.default_address
        slot = self.first(irq)
        if self.serving != IDLE and slot >= self.serving:
            return self.default_address
        if self.depth < 18:
            self.served[self.depth] = self.serving
            self.depth += 1
        self.serving = slot
        return self.addresses[slot] if slot < SLOTS else self.default_address

    @cython.cfunc
    @cython.boundscheck(False)
    @cython.wraparound(False)
    def end(self) -> cython.void:
        """Write VICVectAddr."""
        if self.depth:
            self.depth -= 1
            self.serving = self.served[self.depth]

    @cython.ccall
    def place_slots(self) -> object:
        """A slot's control was written: which slot each input has."""
        for number in range(32):
            self.slot_of[number] = 16
        for slot in range(15, -1, -1):
            if self.controls[slot] & SLOT_ENABLED:
                self.slot_of[self.controls[slot] & 31] = slot

    def read(self, offset: cython.longlong) -> cython.longlong:
        active: cython.longlong
        if offset == 0x30:
            return self.begin()
        self.steady = True
        if offset == 0x00 or offset == 0x04:
            active = (self.raw | self.soft) & self.enabled
            return active & self.selected if offset else active & ~self.selected
        if offset == 0x08:
            return self.raw | self.soft
        if offset == 0x0C:
            return self.selected
        if offset == 0x10:
            return self.enabled
        if offset == 0x18:
            return self.soft
        if offset == 0x20:
            return self.protection
        if offset == 0x34:
            return self.default_address
        if 0x100 <= offset < 0x140:
            return self.addresses[offset >> 2 & 15]
        if 0x200 <= offset < 0x240:
            return self.controls[offset >> 2 & 15]
        return self.unknown(offset, False)

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        if offset == 0x30:
            self.end()
        elif offset == 0x0C:
            self.selected = value
        elif offset == 0x10:
            self.enabled |= value
        elif offset == 0x14:
            self.enabled &= ~value
        elif offset == 0x18:
            self.soft |= value
        elif offset == 0x1C:
            self.soft &= ~value
        elif offset == 0x20:
            self.protection = value & 1
        elif offset == 0x34:
            self.default_address = value
        elif 0x100 <= offset < 0x140:
            self.addresses[offset >> 2 & 15] = value
        elif 0x200 <= offset < 0x240:
            self.controls[offset >> 2 & 15] = value & 0x3F
            self.place_slots()
        else:
            self.unknown(offset, True)
        return 0
