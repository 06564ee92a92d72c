"""The common part of the CAN controllers: counters, acceptance filter, error state, and the bits of their registers.

The bits are those of the LPC2194, whose controllers are in can_controller.py; the generic ones with CAN FD
(can_fd_controller.py) have the same, so that a program needs one set of names.
"""

from typing import Annotated, Final

import cython

from ranger_sim.can_bus.acceptance import Acceptance
from ranger_sim.can_bus.node import WARNING_LIMIT
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import InterruptSource
from ranger_sim.foundation.events import (
    CAN_FILTER,
    CAN_RX,
    CAN_STATUS,
    CAN_TX_DONE,
    TX_ABORTED,
    EventQueue,
)
from ranger_sim.foundation.user_error import FirmwareError

MOD_RESET: Final = 0x1  # CxMOD: reset mode

# CxICR and CxIER: the bits of the controller itself; those from the bus, ICR_*, are in can_bus/node.py.
ICR_RI: Final = 0x1  # a frame waits
ICR_TI1: Final = 0x2  # transmit buffer 1 has ended
ICR_DOI: Final = 0x8  # data overrun
ICR_ALI: Final = 0x40  # arbitration lost
ICR_TI2: Final = 0x200
ICR_TI3: Final = 0x400
# ends of transmissions as bits 1 ... 3; those of buffers 2 and 3 are higher up in CxICR
ENDED_1: Final = 0x2
ENDED_2_3: Final = 0xC
TI2_SHIFT: Final = 7

# CxSR, once per transmit buffer
SR_RBS: Final = 0x1  # a frame waits
SR_DOS: Final = 0x2  # data overrun
SR_TBS: Final = 0x4  # the transmit buffer is free
SR_TCS: Final = 0x8  # its last transmission was completed
SR_ES: Final = 0x40  # an error counter is at the warning limit
SR_BS: Final = 0x80  # bus-off

# CxGSR: as CxSR above, TBS and TCS of all three buffers together, and the error counters
GSR_RX_ERRORS_SHIFT: Final = 16
GSR_TX_ERRORS_SHIFT: Final = 24
ERROR_COUNTER_MASK: Final = 0xFF


@cython.cfunc
@cython.exceptval(check=False)
def buffers_of(word: cython.longlong) -> cython.longlong:
    """TI1 ... TI3 of a CxICR or CxIER value, as bits 1 ... 3."""
    return word & ENDED_1 | word >> TI2_SHIFT & ENDED_2_3


@cython.cclass
class CanControllerBase(Peripheral):
    """Controller `number` (1 ... 4), field a of all its messages. Counters are ground truth for tests.

    kind: of controller, for messages. IER: which events ask for an interrupt at first. `noted`: what ICR shows until
    it is read. `tx_status` of a buffer is 0 while it transmits.
    """

    # what a frame touches; registers of the chip have 32 bits
    rx_source: InterruptSource
    tx_source: InterruptSource
    MOD: cython.longlong
    IER: Annotated[cython.longlong, "readonly"]
    acceptance: Acceptance
    noted: cython.longlong
    number: cython.longlong
    tx_status: cython.longlong[4]
    received: cython.longlong
    sent: cython.longlong
    requests: cython.longlong
    # the rest
    data_overruns: cython.longlong
    lost: cython.longlong
    aborted: cython.longlong
    refused: cython.longlong
    overrun: cython.bint
    bus_off: cython.bint
    error_warning: cython.bint
    tx_errors: cython.longlong
    rx_errors: cython.longlong
    error_source: InterruptSource
    kind: str

    def __init__(self, chip, number, IER, kind) -> None:
        Peripheral.__init__(self, chip)
        self.kind = kind
        if not 1 <= number <= 4:
            raise FirmwareError(f"{chip.name}: {kind} {number} is not 1 ... 4")
        self.number = number
        self.acceptance = None
        self.MOD = 0
        self.IER = IER
        self.noted = 0
        self.tx_status = [SR_TBS | SR_TCS] * 4
        self.overrun = False
        self.bus_off = False
        self.error_warning = False
        self.tx_errors = 0
        self.rx_errors = 0
        self.received = 0
        self.data_overruns = 0
        self.requests = 0
        self.sent = 0
        self.lost = 0
        self.aborted = 0
        self.refused = 0
        self.rx_source = chip.vic.source(CAN_RX, number)
        self.tx_source = chip.vic.source(CAN_TX_DONE, number)
        self.error_source = chip.vic.source(CAN_STATUS, number)
        chip.claim(CAN_RX, number, self)
        chip.claim(CAN_TX_DONE, number, self)
        chip.claim(CAN_STATUS, number, self)

    def where(self) -> str:
        """Its name at the beginning of a message."""
        return f"{self.chip.name}: {self.kind} {self.number}"

    # --- acceptance filter --------------------------------------------------------------------------------

    def accept_all(self) -> None:
        """Let every frame pass: the filter is in bypass."""
        self.set_filter(None)

    def set_filter(self, data: bytes | None) -> None:
        """Set the filter by the bytes of `can_bus.acceptance`; None: every frame passes."""
        self.acceptance = None if data is None else Acceptance(data)
        self.chip.outbox.push(self.chip.now, 0, CAN_FILTER, self.number, int(data is not None), 0, 0, 0, 0, data)

    def filter_bytes(self) -> bytes | None:
        """What `set_filter` was called with last."""
        return None if self.acceptance is None else self.acceptance.data

    # --- what the bus reports -----------------------------------------------------------------------------

    @cython.cfunc
    @cython.exceptval(check=False)
    def count_unsent(self, buffer: cython.longlong, status: cython.longlong) -> cython.void:
        """The transmission from a buffer has ended without success: TX_ABORTED or TX_LOST."""
        self.tx_status[buffer] |= SR_TBS
        if status == TX_ABORTED:
            self.aborted += 1
        else:
            self.lost += 1

    @cython.cfunc
    def take_overrun(self) -> InterruptSource | None:
        """A frame that no place is left for is lost; the interrupt is for the first one since the bit was cleared."""
        self.data_overruns += 1
        if self.overrun:  # DOI comes when the status bit rises, and CDO was not commanded since
            return None
        self.overrun = True
        self.noted |= ICR_DOI
        if self.IER & ICR_DOI:
            return self.error_source
        return None

    @cython.cfunc
    def take_status(self, queue: EventQueue) -> InterruptSource | None:
        """A change of the error state (CAN_STATUS); bus-off puts the controller into reset mode."""
        self.tx_errors = queue.c
        self.rx_errors = queue.d
        self.error_warning = queue.c >= WARNING_LIMIT or queue.d >= WARNING_LIMIT
        self.noted |= queue.b
        if queue.e and not self.bus_off:
            self.bus_off = True
            self.MOD |= MOD_RESET
            self.free_buffers()
        elif not queue.e:
            self.bus_off = False
        if self.IER & queue.b:
            return self.error_source
        return None

    @cython.cfunc
    @cython.exceptval(check=False)
    def free_buffers(self) -> cython.void:
        """No buffer is occupied any more."""
        buffer: cython.longlong
        for buffer in range(1, 4):
            self.tx_status[buffer] |= SR_TBS

    # --- status -------------------------------------------------------------------------------------------

    @cython.cfunc
    @cython.exceptval(check=False)
    def common_status(self, waits: cython.bint) -> cython.longlong:
        """The bits of CxSR that concern no single buffer; waits: a frame does."""
        word: cython.longlong = 0
        if waits:
            word |= SR_RBS
        if self.overrun:
            word |= SR_DOS
        if self.error_warning:
            word |= SR_ES
        if self.bus_off:
            word |= SR_BS
        return word

    @cython.cfunc
    @cython.exceptval(check=False)
    def error_counts(self) -> cython.longlong:
        """The error counters as CxGSR has them."""
        word: cython.longlong = (self.rx_errors & ERROR_COUNTER_MASK) << GSR_RX_ERRORS_SHIFT
        return word | (self.tx_errors & ERROR_COUNTER_MASK) << GSR_TX_ERRORS_SHIFT
