"""A CAN FD controller, of no particular chip: three transmit buffers, a receive queue, an acceptance filter.

Bits of its interrupts (IER, ICR), its status (GSR) and its mode (MOD) are those of the LPC2194's classic controllers
(can_controller_base.py), so that a program needs one set of names. The rest is generic:

Transmit: a buffer holds up to 64 bytes and goes out as CAN_REQUEST with these bytes; its end comes as CAN_TX_DONE.
Receive: a queue of RECEIVE_FRAMES frames; a frame that finds it full is a data overrun and lost.
Acceptance filter: `accept` states which identifiers pass; before that every frame does.
Interrupts: (CAN_RX, n) while a frame waits, (CAN_TX_DONE, n), and (CAN_STATUS, n) for errors, each if IER allows it.
Bus-off puts the controller into reset mode; writing MOD = 0 begins the recovery.
Without a data bit rate it is a classic controller: it sends classic frames, and answers CAN FD frames with form errors.
"""

from typing import Annotated, Final

import cython

from ranger_sim.can_bus.acceptance import Ranges, packed
from ranger_sim.can_bus.fd_frame import LENGTHS, fd_data_length
from ranger_sim.can_bus.frame import HIGHEST_EXTENDED, HIGHEST_STANDARD, data_length
from ranger_sim.firmware_sim.peripherals.can_controller_base import (
    ICR_RI,
    MOD_RESET,
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
    CAN_REQUEST,
    CAN_RX,
    CAN_TX_DONE,
    FLAG_BRS,
    FLAG_ESI,
    FLAG_EXTENDED,
    FLAG_FD,
    FLAG_REMOTE,
    TX_SENT,
)
from ranger_sim.foundation.user_error import FirmwareError

RECEIVE_FRAMES: Final = 32  # chosen by us: controllers have from three to 64 places in a receive queue
KNOWN_FLAGS: Final = 0x750  # of a request: CAN FD, BRS, ESI, extended, remote


@cython.final
@cython.cclass
class CanFdController(CanControllerBase):
    """Controller `number` (1 ... 4); what it has in common with other kinds is in the base class.

    bit_rate, data_bit_rate: bit/s of the two phases; the bus must have the same (`harness.machine.Machine`).
    """

    waiting: list
    bit_rate: Annotated[cython.longlong, "readonly"]
    data_bit_rate: Annotated[cython.longlong, "readonly"]

    def __init__(self, chip, number=1, bit_rate=500_000, data_bit_rate=2_000_000, IER=ICR_RI) -> None:
        CanControllerBase.__init__(self, chip, number, IER, "CAN FD controller")
        if bit_rate < 1 or (data_bit_rate and data_bit_rate < bit_rate):
            raise FirmwareError(
                f"{self.where()}: {bit_rate} and {data_bit_rate} bit/s: the first is at least "
                "1, the second, of the data, not lower, or 0 for classic CAN"
            )
        self.bit_rate = bit_rate
        self.data_bit_rate = data_bit_rate
        self.waiting = []  # (identifier, flags, data) received, the oldest first

    def can_rates(self) -> tuple[int, int] | None:
        """Its bit rates, bit/s, of the two phases; None without a data bit rate, as of a classic controller."""
        return (self.bit_rate, self.data_bit_rate) if self.data_bit_rate else None

    # --- acceptance filter --------------------------------------------------------------------------------

    def accept(self, standard: Ranges = (), extended: Ranges = ()) -> None:
        """Let only frames with these identifiers, of 11 and of 29 bits, pass: single ones, or (first, last).

        FirmwareError for an identifier that does not exist, and for more than 223 ranges of 29 bits.
        """
        self.set_filter(packed(self.where(), standard, extended))

    # --- transmit -----------------------------------------------------------------------------------------

    def fault_of(self, identifier, flags, data) -> str:
        """The fault of a frame to send; empty when it can be sent. flags: without the length code."""
        highest = HIGHEST_EXTENDED if flags & FLAG_EXTENDED else HIGHEST_STANDARD
        if not 0 <= identifier <= highest:
            return f"identifier {identifier:#x} is above {highest:#x}"
        if flags & ~KNOWN_FLAGS:
            return f"flags {flags:#x} cannot be sent"
        if flags & FLAG_FD:
            if flags & FLAG_REMOTE:
                return "CAN FD has no remote frames"
            if not self.data_bit_rate:
                return "a CAN FD frame, and the controller was started without a data bit rate"
            if len(data) not in LENGTHS:
                return f"{len(data)} data bytes; a CAN FD frame has {', '.join(map(str, LENGTHS))}"
        elif flags & (FLAG_BRS | FLAG_ESI):
            return "BRS and ESI are bits of CAN FD frames, and this frame is classic"
        elif len(data) > 8:
            return f"{len(data)} data bytes; a classic frame has at most 8"
        return ""

    def transmit(self, buffer, identifier, flags, data) -> bool:
        """Fill buffer 1 ... 3 and request it: False, and refused, when it is not free, or in reset.

        flags: FLAG_FD, FLAG_BRS, FLAG_ESI, FLAG_EXTENDED, FLAG_REMOTE. data: bytes, whose number is a length of such a
        frame. FirmwareError for a frame that does not exist.
        """
        if not 1 <= buffer <= 3:
            raise IndexError(f"{self.where()}: transmit buffer {buffer} is not 1 ... 3")
        data = bytes(data)
        fault = self.fault_of(identifier, flags, data)
        if fault:
            raise FirmwareError(f"{self.where()}: identifier {identifier:#x}: {fault}")
        if self.tx_status[buffer] == 0 or self.MOD & MOD_RESET:
            self.refused += 1
            return False
        self.tx_status[buffer] = 0
        self.requests += 1
        low, high = int.from_bytes(data[:4], "little"), int.from_bytes(data[4:8], "little")
        if flags & FLAG_FD:
            flags |= LENGTHS.index(len(data))
            self.chip.outbox.push(
                self.chip.now, 0, CAN_REQUEST, self.number, buffer, identifier, flags, low, high, data
            )
        else:
            self.chip.outbox.request(self.chip.now, self.number, buffer, identifier, flags | len(data), low, high)
        return True

    @cython.ccall
    @cython.exceptval(check=False)
    def buffer_free(self, buffer: cython.longlong) -> cython.bint:
        """Whether transmit buffer 1 ... 3 is free."""
        return self.tx_status[buffer & 3] != 0

    def abort(self, buffer) -> None:
        """Abort what waits in transmit buffer 1 ... 3."""
        if not self.buffer_free(buffer):
            self.chip.outbox.push(self.chip.now, 0, CAN_ABORT, self.number, buffer)

    # --- receive ------------------------------------------------------------------------------------------

    def receive(self) -> tuple[int, int, bytes] | None:
        """Take the oldest frame received out of the queue: identifier, flags with the length code, data; or None."""
        if not self.waiting:
            return None
        frame = self.waiting.pop(0)
        if self.waiting:
            if self.IER & ICR_RI:
                self.chip.vic.raise_source(self.rx_source, self.chip.now)
        elif self.rx_source.pending:  # the line falls: nothing waits any more
            self.rx_source.forgotten += 1
            self.chip.vic.pending &= ~self.rx_source.bit
        return frame

    def on_message(self, queue) -> InterruptSource | None:
        """Take a message of the bus: a frame received, the end of a transmission, a change of the error state."""
        buffer: cython.longlong
        if queue.kind == CAN_RX:
            if self.MOD & MOD_RESET:
                return None
            if self.acceptance is not None and not self.acceptance.accepts(queue.b, queue.c):
                return None
            if len(self.waiting) >= RECEIVE_FRAMES:
                return self.take_overrun()
            data = queue.ref
            if data is None:
                words = (queue.d & 0xFFFFFFFF).to_bytes(4, "little") + (queue.e & 0xFFFFFFFF).to_bytes(4, "little")
                data = words[: fd_data_length(queue.c) if queue.c & FLAG_FD else data_length(queue.c)]
            self.waiting.append((queue.b, queue.c, data))
            self.received += 1
            return self.rx_source if self.IER & ICR_RI else None
        if queue.kind == CAN_TX_DONE:
            buffer = queue.b & 3
            self._end(buffer, queue.c)
            return self.tx_source if buffers_of(self.IER) >> buffer & 1 else None
        return self.take_status(queue)

    @cython.cfunc
    def _end(self, buffer: cython.longlong, status: cython.longlong) -> cython.void:
        """The transmission from a buffer has ended."""
        self.noted |= 1 << buffer if buffer == 1 else 1 << (buffer + TI2_SHIFT)
        if status == TX_SENT:
            self.sent += 1
            self.tx_status[buffer] = SR_TBS | SR_TCS
        else:
            self.count_unsent(buffer, status)

    # --- status -------------------------------------------------------------------------------------------

    def write_MOD(self, mode) -> None:
        """Bit 0: 1 reset mode, 0 operating (after bus-off: begin the recovery)."""
        if mode & MOD_RESET:
            self.waiting.clear()
            self.free_buffers()
        self.MOD = mode
        self.chip.outbox.push(self.chip.now, 0, CAN_MODE, self.number, mode & MOD_RESET)

    def write_IER(self, value) -> None:
        """Set which events ask for an interrupt from now on."""
        self.IER = value

    def clear_overrun(self) -> None:
        """Clear the status bit of a data overrun."""
        self.overrun = False

    def read_ICR(self) -> int:
        """What has happened since the last read, as CxICR: the read clears all but the receive bit."""
        value = self.noted | (ICR_RI if self.waiting else 0)
        self.noted = 0
        return value

    def GSR(self) -> int:
        """The status, as CxGSR."""
        buffers: cython.longlong = self.tx_status[1] & self.tx_status[2] & self.tx_status[3]
        word: cython.longlong = buffers & (SR_TBS | SR_TCS) | self.common_status(len(self.waiting) > 0)
        return word | self.error_counts()
