"""The four CAN controllers' registers, and what they share: acceptance filter and central status.

LPC2194 user manual, CAN controllers and acceptance filter. The filter is off, in bypass (CxRFS has its bit BP then), or
looks identifiers up in its table; which entry it was, the index in CxRFS, is 0. The controllers are
peripherals/can_controller.py.
"""

from typing import Final

import cython

from ranger_sim.can_bus.acceptance import packed
from ranger_sim.can_bus.node import WARNING_LIMIT
from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.lpc2194.vic import CAN1_RX_INPUT, CAN1_TX_INPUT, CAN_INPUT
from ranger_sim.firmware_sim.peripherals.can_controller import CMR_SRR, TABLE_BYTES, CanController
from ranger_sim.firmware_sim.peripherals.can_controller_base import ICR_RI, MOD_RESET
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.user_error import BusError

AFMR_OFF: Final = 1
AFMR_BYPASS: Final = 2
# an entry of the table: 16 bits for an identifier of 11, 32 for one of 29
SFF_IDENTIFIER: Final = 0x7FF
SFF_DISABLED: Final = 0x1000
SFF_CONTROLLER_SHIFT: Final = 13
EFF_IDENTIFIER: Final = 0x1FFFFFFF
EFF_CONTROLLER_SHIFT: Final = 29
RFS_BP: Final = 0x400  # the frame was received in bypass
TX_BITS: Final = 0x602  # TI1, TI2, TI3 in CxICR and CxIER
MOD_KNOWN: Final = 0x09  # CxMOD: reset mode, and transmit priority by the PRIO of the buffers

NAMES = {
    0x00: ("MOD", "rw"),
    0x04: ("CMR", "w"),
    0x08: ("GSR", "rw"),
    0x0C: ("ICR", "r"),
    0x10: ("IER", "rw"),
    0x14: ("BTR", "rw"),
    0x18: ("EWL", "rw"),
    0x1C: ("SR", "r"),
    0x20: ("RFS", "rw"),
    0x24: ("RID", "rw"),
    0x28: ("RDA", "rw"),
    0x2C: ("RDB", "rw"),
    **{
        0x20 + 0x10 * buffer + 4 * place: (f"{name}{buffer}", "rw")
        for buffer in (1, 2, 3)
        for place, name in enumerate(("TFI", "TID", "TDA", "TDB"))
    },
}


@cython.final
@cython.cclass
class CanFilterBlock(Block):
    """Acceptance filter: AFMR, and the starts of the table's sections. `ram`: the words of the table."""

    controllers: list
    mode: cython.longlong
    table: cython.longlong[8]
    ram: list

    REGISTERS = {
        0x00: ("AFMR", "rw"),
        0x04: ("SFF_sa", "rw"),
        0x08: ("SFF_GRP_sa", "rw"),
        0x0C: ("EFF_sa", "rw"),
        0x10: ("EFF_GRP_sa", "rw"),
        0x14: ("ENDofTable", "rw"),
        0x18: ("LUTerrAd", "r"),
        0x1C: ("LUTerr", "r"),
    }

    def __init__(self, chip, clocks) -> None:
        Block.__init__(self, chip, clocks, "CAN acceptance filter", 0xE003C000, 1 << 19)
        self.controllers = []  # the four CanBlocks, whose errors share this line
        self.mode = 1  # AFMR_OFF
        self.table = [0] * 8
        self.ram = [0] * (TABLE_BYTES // 4)

    def requests(self) -> cython.longlong:
        block: CanBlock
        for each in self.controllers:
            block = each
            if block.can.noted & block.can.IER:
                return 1 << CAN_INPUT
        return 0

    def read(self, offset: cython.longlong) -> cython.longlong:
        self.steady = True
        if offset == 0:
            return self.mode
        if 0 < offset < 0x18:
            return self.table[offset >> 2]
        if offset == 0x18 or offset == 0x1C:
            return 0  # a table that is not used has no errors
        return self.unknown(offset, False)

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        if offset == 0:
            if value & ~3:
                self.not_modelled(f"AFMR {value:#x}: frames that the filter stores by itself")
            self.mode = value & 3
            self._set_filters()
        elif 0 < offset < 0x18:
            self.table[offset >> 2] = value
        else:
            self.unknown(offset, True)
        return 0

    def _set_filters(self) -> None:
        """Let the table act where the mode is 0; no filter of a controller has an effect otherwise."""
        for place, block in enumerate(self.controllers):
            if self.mode == 0:
                block.can.set_filter(self._filter_of(place))
            elif block.can.filter_bytes() is not None:
                block.can.set_filter(None)

    def _filter_of(self, controller) -> bytes:
        """What the table lets through to controller 0 ... 3."""
        _, sff, sff_groups, eff, eff_groups, end = (self.table[place] >> 2 for place in range(6))
        if not sff <= sff_groups <= eff <= eff_groups <= end <= TABLE_BYTES // 4:
            self.not_modelled("a table whose sections do not follow each other within its 2 KB")
        halves = [half for word in self.ram[sff:sff_groups] for half in (word >> 16, word & 0xFFFF)]
        groups = [(word >> 16, word & 0xFFFF) for word in self.ram[sff_groups:eff]]
        words = self.ram[eff_groups:end]
        standard = [
            (first & SFF_IDENTIFIER, last & SFF_IDENTIFIER)
            for first, last in [*((half, half) for half in halves), *groups]
            if first >> SFF_CONTROLLER_SHIFT == controller and not first & SFF_DISABLED
        ]
        extended = [
            (first & EFF_IDENTIFIER, last & EFF_IDENTIFIER)
            for first, last in [
                *((word, word) for word in self.ram[eff:eff_groups]),
                *zip(words[::2], words[1::2], strict=False),
            ]
            if first >> EFF_CONTROLLER_SHIFT == controller
        ]
        try:
            return packed(self.name, standard, extended)
        except BusError as error:
            self.not_modelled(f"its table: {error};")
            raise


@cython.final
@cython.cclass
class CanFilterRam(Block):
    """The lookup table of the acceptance filter, in words."""

    filter: CanFilterBlock

    REGISTERS = {0: ("AFRAM", "rw")}
    MEMORY = TABLE_BYTES

    def __init__(self, chip, clocks, acceptance) -> None:
        Block.__init__(self, chip, clocks, "CAN acceptance filter RAM", 0xE0038000)
        self.filter = acceptance

    def read(self, offset: cython.longlong) -> cython.longlong:
        self.steady = True
        if offset >= TABLE_BYTES:
            return self.unknown(offset, False)
        return self.filter.ram[offset >> 2]

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        if offset >= TABLE_BYTES:
            self.unknown(offset, True)
        elif self.filter.mode == 0:
            self.not_modelled("writing the table while it is in use (AFMR 0)")
        else:
            self.filter.ram[offset >> 2] = value & 0xFFFF_FFFF
        return 0


@cython.final
@cython.cclass
class CanBlock(Block):
    """Controller `number`. In reset mode after power-up, as the chip."""

    can: CanController
    acceptance: CanFilterBlock
    number: cython.longlong
    set_up: cython.bint

    READ_ACTS = frozenset({0x0C})
    REGISTERS = dict(NAMES)

    def __init__(self, chip, clocks, number, acceptance) -> None:
        Block.__init__(
            self,
            chip,
            clocks,
            f"CAN{number}",
            0xE0044000 + 0x4000 * (number - 1),
            1 << (20 + number - 1) | 1 << (26 + number - 1),
        )
        self.can = CanController(chip, number, btr=0, IER=0)
        self.can.MOD = 1
        self.acceptance = acceptance
        self.partner = acceptance
        acceptance.controllers.append(self)
        self.number = number
        self.set_up = False  # it has left reset mode once

    def requests(self) -> cython.longlong:
        can: CanController = self.can
        lines: cython.longlong = 0
        if can.IER == 0:
            return 0
        if can.IER & ICR_RI and can.rx_count > 0:
            lines |= 1 << (CAN1_RX_INPUT + self.number - 1)
        if can.ended & can.end_interrupts:
            lines |= 1 << (CAN1_TX_INPUT + self.number - 1)
        return lines

    def read(self, offset: cython.longlong) -> cython.longlong:
        can: CanController = self.can
        bypass: cython.longlong
        buffer: cython.longlong
        if offset == 0x1C or offset == 0x08:
            # the ends of transmissions are known beforehand: the word is final when no end is to come
            self.steady = can.ends.times[1] >= NEVER and can.ends.times[2] >= NEVER and can.ends.times[3] >= NEVER
            return can.SR() if offset == 0x1C else can.GSR()
        if offset == 0x0C:
            return can.read_ICR()
        self.steady = True
        if offset == 0x20:
            bypass = RFS_BP if can.rx_count > 0 and self.acceptance.mode & AFMR_BYPASS else 0
            return can.RFS | bypass
        if offset == 0x24:
            return can.RID
        if offset == 0x28:
            return can.RDA
        if offset == 0x2C:
            return can.RDB
        if offset == 0x00:
            return can.MOD
        if offset == 0x10:
            return can.IER
        if offset == 0x14:
            return can.BTR
        if offset == 0x18:
            return WARNING_LIMIT
        if 0x30 <= offset < 0x60:
            buffer = (offset >> 4) - 2
            if offset & 12 == 0:
                return can.TFI[buffer]
            if offset & 12 == 4:
                return can.TID[buffer]
            return can.TDA[buffer] if offset & 12 == 8 else can.TDB[buffer]
        return self.unknown(offset, False)

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        can: CanController = self.can
        buffer: cython.longlong
        if offset == 0x04:
            if value & CMR_SRR:
                self.not_modelled("SRR, the reception of its own frame,")
            can.write_CMR(value & 0xFF)
        elif 0x30 <= offset < 0x60:
            buffer = (offset >> 4) - 2
            if offset & 12 == 0:
                can.TFI[buffer] = value
            elif offset & 12 == 4:
                can.TID[buffer] = value
            elif offset & 12 == 8:
                can.TDA[buffer] = value
            else:
                can.TDB[buffer] = value
        elif offset == 0x00:
            if value & ~MOD_KNOWN:
                self.not_modelled(f"MOD {value:#x}: listen-only, self-test and sleep mode")
            if value & MOD_RESET == 0:
                self.set_up = True
            can.write_MOD(value)
        elif offset == 0x10:
            can.write_IER(value & 0x7FF)
            self.report_ends()
        elif offset == 0x14:
            can.BTR = value & 0xFFFFFF
        elif offset == 0x18:
            if value != WARNING_LIMIT:
                self.not_modelled(f"an error warning limit of {value} (it is always {WARNING_LIMIT})")
        elif offset == 0x08:
            if value:
                self.not_modelled(f"setting GSR's error counters to {value:#x}")
            can.tx_errors = can.rx_errors = 0
        elif 0x20 <= offset < 0x30:
            if can.MOD & MOD_RESET == 0:
                self.not_modelled("writing a received frame")
        else:
            self.unknown(offset, True)
        return 0

    @cython.ccall
    def report_ends(self) -> object:
        """Make ends of transmissions events when the program enables their interrupt."""
        can: CanController = self.can
        wanted: cython.longlong = can.IER & TX_BITS and 1
        if can.tx_source.bit != wanted:
            can.tx_source.bit = wanted
            if wanted:
                can.write_IER(can.IER)
