# cython: boundscheck=False, wraparound=False
# (every index below is a transmit buffer, 1 ... 3: `transmit` and the bus's answers are held against that)
"""One CAN controller of the LPC2194 (CxMOD, CxCMR, CxGSR, CxSR, CxICR, CxIER, CxBTR, CxRFS, CxRID, CxRDA,
CxRDB, and CxTFI1-3, CxTID1-3, CxTDA1-3, CxTDB1-3 as TFI[1] ... TDB[3]).

Three transmit buffers: a request goes out as CAN_REQUEST. Its end comes as CAN_TX_DONE, or the bus writes it into
`ends` beforehand, and the controller takes it in when a register that depends on it is read; then it is a message only
where an interrupt or a caller of `report_end` waits for it. Transmit and abort in one command is single shot.
Receive: two hardware buffers, the older in RFS ... RDB; a third frame is a data overrun and lost.
Acceptance filter (AFMR, SFF_sa ... ENDofTable): `accept` states which identifiers pass; before that it is in bypass. A
frame under way while it changes passes when both filters let it through.
Interrupts: (CAN_RX, n) while a frame waits, (CAN_TX_DONE, n), and (CAN_STATUS, n) for errors, each if CxIER allows it.
Bus-off puts the controller into reset mode; writing MOD = 0 begins the recovery.
"""

from typing import Final

import cython

from ranger_sim.can_bus.acceptance import Ranges, packed

# handed on to the boards, which see the controller and not the bus
from ranger_sim.can_bus.node import ICR_BUS_ERROR as ICR_BUS_ERROR  # noqa: PLC0414
from ranger_sim.can_bus.node import ICR_ERROR_PASSIVE as ICR_ERROR_PASSIVE  # noqa: PLC0414
from ranger_sim.can_bus.node import ICR_ERROR_WARNING as ICR_ERROR_WARNING  # noqa: PLC0414
from ranger_sim.can_bus.node import ICR_RECEIVING as ICR_RECEIVING  # noqa: PLC0414
from ranger_sim.can_bus.transmit_ends import TransmitEnds
from ranger_sim.firmware_sim.peripherals.can_controller_base import (
    ENDED_1,
    ENDED_2_3,
    ICR_RI,
    MOD_RESET,
    SR_BS,
    SR_DOS,
    SR_ES,
    SR_RBS,
    SR_TBS,
    SR_TCS,
    TI2_SHIFT,
    CanControllerBase,
    buffers_of,
)
from ranger_sim.firmware_sim.vic import InterruptSource
from ranger_sim.foundation.events import (
    CAN_ABORT,
    CAN_MODE,
    CAN_RX,
    CAN_TX_DONE,
    FLAG_EXTENDED,
    FLAG_REMOTE,
    FLAG_SINGLE_SHOT,
    NEVER,
    TX_SENT,
)
from ranger_sim.foundation.user_error import FirmwareError

TABLE_BYTES: Final = 2048  # of the acceptance filter's lookup table

# CxCMR
CMR_TR: Final = 0x1  # transmission request
CMR_AT: Final = 0x2  # abort transmission
CMR_RRB: Final = 0x4  # release receive buffer
CMR_CDO: Final = 0x8  # clear data overrun
CMR_SRR: Final = 0x10  # self reception request: not modelled
CMR_STB1: Final = 0x20  # select transmit buffer
CMR_STB2: Final = 0x40
CMR_STB3: Final = 0x80

SR_BUFFER_BITS: Final = 8  # of a transmit buffer in CxSR

# CxRFS and CxTFI: DLC in bits 16-19, RTR bit 30, FF (extended identifier) bit 31; from a message's flags by shifts
DLC_MASK: Final = 0xF
DLC_SHIFT: Final = 16
RTR_SHIFT: Final = 26  # of FLAG_REMOTE
FF_SHIFT: Final = 25  # of FLAG_EXTENDED
EIGHT_BYTES: Final = 8  # flags of nearly every frame: DLC 8, neither remote nor extended
RFS_EIGHT_BYTES: Final = 0x80000  # the same in CxRFS


def btr_value(brp, sjw, tseg1, tseg2, sam=0) -> int:
    """CxBTR from its fields as written, each one less than what it means: BRP, SJW, TSEG1, TSEG2, SAM."""
    for name, value, limit in (
        ("BRP", brp, 1023),
        ("SJW", sjw, 3),
        ("TSEG1", tseg1, 15),
        ("TSEG2", tseg2, 7),
        ("SAM", sam, 1),
    ):
        if not 0 <= value <= limit:
            raise FirmwareError(f"CxBTR: {name} {value} is not 0 ... {limit}")
    return brp | sjw << 14 | tseg1 << 16 | tseg2 << 20 | sam << 23


def bit_rate_of(btr, hz) -> float:
    """Bits per second that a CxBTR value gives at a peripheral clock of `hz`."""
    return hz / (((btr & 1023) + 1) * (3 + (btr >> 16 & 15) + (btr >> 20 & 7)))


def sample_point_of(btr) -> float:
    """Sample point of a CxBTR value as a fraction of the bit."""
    before = 2 + (btr >> 16 & 15)
    return before / (before + 1 + (btr >> 20 & 7))


@cython.cfunc
@cython.exceptval(check=False)
def frame_word(flags: cython.longlong) -> cython.longlong:
    """CxRFS and CxTFI of a frame with these flags (foundation/events.py)."""
    if flags == EIGHT_BYTES:
        return RFS_EIGHT_BYTES
    return (flags & DLC_MASK) << DLC_SHIFT | (flags & FLAG_REMOTE) << RTR_SHIFT | (flags & FLAG_EXTENDED) << FF_SHIFT


def table_bytes(standard: Ranges, extended: Ranges) -> int:
    """Bytes of the acceptance filter's lookup table that these identifiers take; UM10114, section on its RAM."""
    half_words = sum(not isinstance(each, tuple) for each in standard)
    words = (half_words + 1) // 2 + sum(isinstance(each, tuple) for each in standard)
    return 4 * words + sum(8 if isinstance(each, tuple) else 4 for each in extended)


@cython.final
@cython.cclass
class CanController(CanControllerBase):
    """Controller `number` (1 ... 4) of the LPC2194; what it has in common with other kinds is in the base class.

    `sent`, `aborted` and `lost` count the ends that have been taken in.
    """

    # what a frame touches; registers of the chip have 32 bits
    ends: TransmitEnds
    end_interrupts: cython.longlong
    ended: cython.longlong
    rx_count: cython.longlong
    RFS: cython.longlong
    RID: cython.longlong
    RDA: cython.longlong
    RDB: cython.longlong
    second_RFS: cython.longlong
    second_RID: cython.longlong
    second_RDA: cython.longlong
    second_RDB: cython.longlong
    TFI: cython.longlong[4]
    TID: cython.longlong[4]
    TDA: cython.longlong[4]
    TDB: cython.longlong[4]
    # the rest
    BTR: cython.longlong

    def __init__(self, chip, number=1, btr=0x00254001, IER=ICR_RI) -> None:
        # 0x00254001: BRP 1, SJW 1, TSEG1 5, TSEG2 2: 3 Mbit/s at 60 MHz, sampled at 70 %
        CanControllerBase.__init__(self, chip, number, IER, "CAN controller")
        self.ends = TransmitEnds()
        self.end_interrupts = buffers_of(IER)  # by buffer, bits 1 ... 3
        self.ended = 0  # the same way: ends that CxICR shows until it is read
        self.BTR = btr
        self.RFS = 0
        self.RID = 0
        self.RDA = 0
        self.RDB = 0
        self.rx_count = 0
        self.second_RFS = 0
        self.second_RID = 0
        self.second_RDA = 0
        self.second_RDB = 0
        self.TFI = [0] * 4
        self.TID = [0] * 4
        self.TDA = [0] * 4
        self.TDB = [0] * 4

    def transmit_ends(self) -> object:
        """Where a bus writes the ends of its transmissions."""
        return self.ends

    # --- acceptance filter --------------------------------------------------------------------------------

    def accept(self, standard: Ranges = (), extended: Ranges = ()) -> None:
        """Let only frames with these identifiers, of 11 and of 29 bits, pass: single ones, or (first, last).

        The others cost the board nothing, and no simulation either. The lookup table is that of the chip, shared by its
        controllers: FirmwareError where one of them alone takes more than its 2 KB.
        """
        standard, extended = tuple(standard), tuple(extended)
        used = table_bytes(standard, extended)
        data = packed(self.where(), standard, extended)
        if used > TABLE_BYTES:
            raise FirmwareError(
                f"{self.where()}: its acceptance filter takes {used} bytes of the table, which has {TABLE_BYTES}"
            )
        self.set_filter(data)

    @cython.ccall
    def bit_rate(self) -> cython.double:
        """Bits per second by CxBTR and the chip's clock."""
        return bit_rate_of(self.BTR, self.chip.hz)

    # --- transmit ---------------------------------------------------------------------------------------

    @cython.ccall
    @cython.exceptval(check=False)
    def free_at(self, buffer: cython.longlong, time: cython.longlong) -> cython.bint:
        """TBS of a transmit buffer 1 ... 3 by what has happened up to `time` (ns)."""
        buffer &= 3
        if self.ends.times[buffer] <= time:
            self._end(buffer, self.ends.statuses[buffer])
        return self.tx_status[buffer] != 0

    @cython.ccall
    @cython.exceptval(check=False)
    def buffer_free(self, buffer: cython.longlong) -> cython.bint:
        """TBS of a transmit buffer 1 ... 3."""
        return self.free_at(buffer, self.chip.now)

    @cython.ccall
    def report_end(self, buffer: cython.longlong) -> None:
        """Make the next end of a transmission from a buffer arrive as a message."""
        end: cython.longlong = self.ends.times[buffer]
        status: cython.longlong = self.ends.statuses[buffer]
        self.ends.times[buffer] = NEVER + 1  # BY_MESSAGE
        if end < NEVER:
            self.chip.inbox.put(end, self.ends.order, CAN_TX_DONE, self.number, buffer, status, 0, 0, 0)
            if end < self.chip.stop_time:
                self.chip.stop_time = end

    @cython.ccall
    def report_first_end(self) -> None:
        """Make the end that first frees buffer 1 or 2 arrive as a message; neither is free now."""
        if self.ends.times[1] < NEVER:
            self.report_end(1)
        elif self.ends.times[2] < NEVER:
            self.report_end(2)
        else:  # neither has started
            self.report_end(1)
            self.report_end(2)

    @cython.ccall
    def write_IER(self, value: cython.longlong) -> None:
        """Write the interrupt enable register; it counts for what is under way as well."""
        buffer: cython.longlong
        self._take_ends()
        self.IER = value
        self.end_interrupts = buffers_of(value)
        for buffer in range(1, 4):
            if self.end_interrupts >> buffer & 1 and self.tx_source.bit != 0:
                self.report_end(buffer)

    @cython.cfunc
    def _take_ends(self) -> cython.void:
        """Take in every end up to now."""
        buffer: cython.longlong
        for buffer in range(1, 4):
            self.free_at(buffer, self.chip.now)

    @cython.cfunc
    def _end(self, buffer: cython.longlong, status: cython.longlong) -> cython.void:
        """The transmission from a buffer has ended."""
        self.ends.times[buffer] = NEVER
        self.ended |= 1 << buffer
        if status == TX_SENT:
            self.sent += 1
            self.tx_status[buffer] = SR_TBS | SR_TCS
        else:
            self.count_unsent(buffer, status)

    @cython.ccall
    def transmit(
        self,
        buffer: cython.longlong,
        identifier: cython.longlong,
        flags: cython.longlong,
        lo: cython.longlong,
        hi: cython.longlong,
    ) -> cython.bint:
        """Fill a buffer and request it; flags as in foundation/events.py. False, and refused, when it is not free.

        IndexError for a buffer that is not 1 ... 3.
        """
        if self.transmit_if_free(buffer, identifier, flags, lo, hi):
            return True
        self.refused += 1
        return False

    @cython.ccall
    def transmit_if_free(
        self,
        buffer: cython.longlong,
        identifier: cython.longlong,
        flags: cython.longlong,
        lo: cython.longlong,
        hi: cython.longlong,
    ) -> cython.bint:
        """`transmit` by a program that reads the buffer's status first: False when it is not free, or in reset."""
        if not 1 <= buffer <= 3:
            raise IndexError(f"{self.where()}: transmit buffer {buffer} is not 1 ... 3")
        if self.ends.times[buffer] <= self.chip.now:
            self._end(buffer, self.ends.statuses[buffer])
        if self.tx_status[buffer] == 0 or self.MOD & MOD_RESET:
            return False
        self.TFI[buffer] = frame_word(flags)
        self.TID[buffer] = identifier
        self.TDA[buffer] = lo
        self.TDB[buffer] = hi
        self.tx_status[buffer] = 0
        self.requests += 1
        self.chip.outbox.request(self.chip.now, self.number, buffer, identifier, flags, lo, hi)
        if self.end_interrupts >> buffer & 1 and self.tx_source.bit != 0:
            self.report_end(buffer)
        return True

    @cython.ccall
    def write_CMR(self, command: cython.longlong) -> cython.longlong:
        """Write the command register; returns the command."""
        buffer: cython.longlong
        flags: cython.longlong
        frame: cython.longlong
        if command & CMR_RRB:
            self.release()
        if command & CMR_CDO:
            self.overrun = False
        if command & (CMR_TR | CMR_AT) == 0 or self.MOD & MOD_RESET:
            return command
        for buffer in range(1, 4):
            if command >> (buffer - 1) & CMR_STB1:
                if command & CMR_TR:
                    frame = self.TFI[buffer]
                    flags = (
                        frame >> DLC_SHIFT & DLC_MASK
                        | frame >> RTR_SHIFT & FLAG_REMOTE
                        | frame >> FF_SHIFT & FLAG_EXTENDED
                    )
                    if command & CMR_AT:
                        flags |= FLAG_SINGLE_SHOT
                    self.transmit(buffer, self.TID[buffer], flags, self.TDA[buffer], self.TDB[buffer])
                    self.TFI[buffer] = frame  # with the bits that do not travel
                elif not self.buffer_free(buffer):
                    self.chip.outbox.push(self.chip.now, 0, CAN_ABORT, self.number, buffer)
        return command

    # --- receive ----------------------------------------------------------------------------------------

    def on_message(self, queue) -> InterruptSource | None:
        """Take a message of the bus: a frame received, the end of a transmission, a change of the error state."""
        buffer: cython.longlong
        if queue.kind == CAN_RX:
            if self.MOD & MOD_RESET:
                return None
            if self.acceptance is not None and not self.acceptance.accepts(queue.b, queue.c):
                return None
            if self.rx_count == 0:
                self.rx_count = 1
                self.RFS = frame_word(queue.c)
                self.RID = queue.b
                self.RDA = queue.d
                self.RDB = queue.e
            elif self.rx_count == 1:
                self.rx_count = 2
                self.second_RFS = frame_word(queue.c)
                self.second_RID = queue.b
                self.second_RDA = queue.d
                self.second_RDB = queue.e
            else:
                return self.take_overrun()
            self.received += 1
            if self.IER & ICR_RI:
                return self.rx_source
        elif queue.kind == CAN_TX_DONE:
            buffer = queue.b & 3
            self._end(buffer, queue.c)
            if self.end_interrupts >> buffer & 1:
                return self.tx_source
        else:  # CAN_STATUS
            return self.take_status(queue)
        return None

    @cython.ccall
    def release(self) -> cython.void:
        """CMR.RRB: free the older receive buffer; the newer moves up and asks for the interrupt again."""
        if self.rx_count < 2:
            self.rx_count = 0
            return
        self.rx_count = 1
        self.RFS = self.second_RFS
        self.RID = self.second_RID
        self.RDA = self.second_RDA
        self.RDB = self.second_RDB
        if self.IER & ICR_RI:
            self.chip.vic.raise_source(self.rx_source, self.chip.now)

    # --- status -----------------------------------------------------------------------------------------

    @cython.ccall
    def write_MOD(self, mode: cython.longlong) -> cython.void:
        """Bit 0: 1 reset mode, 0 operating (after bus-off: begin the recovery)."""
        self.MOD = mode
        if mode & MOD_RESET:
            self.rx_count = 0
            self.free_buffers()
        self.chip.outbox.push(self.chip.now, 0, CAN_MODE, self.number, mode & MOD_RESET)

    @cython.ccall
    @cython.exceptval(check=False)
    def read_ICR(self) -> cython.longlong:
        """Interrupt and capture register; the read clears all but the receive bit."""
        value: cython.longlong
        self._take_ends()
        value = self.ICR
        self.ended = 0
        self.noted = 0
        return value

    @property
    def ICR(self) -> cython.longlong:
        """The same by the ends taken in so far, without clearing anything."""
        return self.noted | self.ended & ENDED_1 | (self.ended & ENDED_2_3) << TI2_SHIFT | (self.rx_count > 0) * ICR_RI

    @cython.ccall
    @cython.exceptval(check=False)
    def SR(self) -> cython.longlong:
        """Status of the three buffers, 8 bits each."""
        buffer: cython.longlong
        word: cython.longlong = 0
        common: cython.longlong
        self._take_ends()
        common = self.common_status(self.rx_count > 0)
        for buffer in range(1, 4):
            word |= (common | self.tx_status[buffer]) << SR_BUFFER_BITS * (buffer - 1)
        return word

    @cython.ccall
    @cython.exceptval(check=False)
    def GSR(self) -> cython.longlong:
        """Global status: bit 0 RBS, 1 DOS, 2 all buffers free, 3 all complete, 6 ES, 7 BS, 16-23 receive errors,
        24-31 transmit errors."""
        status: cython.longlong = self.SR()
        all_three: cython.longlong = status & status >> SR_BUFFER_BITS & status >> 2 * SR_BUFFER_BITS
        word: cython.longlong = status & (SR_RBS | SR_DOS | SR_ES | SR_BS) | all_three & (SR_TBS | SR_TCS)
        return word | self.error_counts()
