"""The CAN FD controller: what it asks of the bus, what it takes from it, and what it refuses."""

import pytest

from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller import ICR_ERROR_WARNING
from ranger_sim.firmware_sim.peripherals.can_controller_base import ICR_DOI, ICR_RI, ICR_TI1, ICR_TI3
from ranger_sim.firmware_sim.peripherals.can_fd_controller import RECEIVE_FRAMES, CanFdController
from ranger_sim.foundation.events import (
    CAN_ABORT,
    CAN_MODE,
    CAN_REQUEST,
    CAN_RX,
    CAN_STATUS,
    CAN_TX_DONE,
    FLAG_BRS,
    FLAG_EXTENDED,
    FLAG_FD,
    FLAG_REMOTE,
    TX_ABORTED,
    TX_SENT,
)
from ranger_sim.foundation.user_error import UserError

FAST = FLAG_FD | FLAG_BRS
GSR_RBS, GSR_DOS, GSR_TBS, GSR_TCS, GSR_ES, GSR_BS = 1, 2, 4, 8, 0x40, 0x80  # CxGSR, user manual UM10114


class Node:
    """A chip with one controller, on which messages of the bus arrive every 50 us."""

    def __init__(self, **options):
        self.chip = Microcontroller("TEST")
        self.can = CanFdController(self.chip, **options)
        self.time = 0

    def arrives(self, kind, *fields, ref=None):
        self.time += 50_000
        self.chip.inbox.push(self.time, 512, kind, self.can.number, *fields, *[0] * (5 - len(fields)), ref)
        self.chip.advance(self.time + 1)

    def receives(self, identifier, flags, data):
        low, high = int.from_bytes(data[:4], "little"), int.from_bytes(data[4:8], "little")
        self.arrives(CAN_RX, identifier, flags, low, high, 0, ref=data if flags & FLAG_FD else None)

    def requests(self):
        box = self.chip.outbox
        out = []
        while box.take():
            out.append((box.kind, box.a, box.b, box.c, box.d, box.e, box.f, box.ref))
        return out


def test_a_request_carries_the_length_code_of_64_bytes_and_all_of_them():
    node = Node(number=2)
    data = bytes(range(64))
    assert node.can.transmit(3, 0x123, FAST, data)
    assert node.requests() == [(CAN_REQUEST, 2, 3, 0x123, FAST | 15, 0x03020100, 0x07060504, data)]


def test_a_classic_frame_goes_out_as_from_a_classic_controller():
    node = Node()
    assert node.can.transmit(1, 0x1ABCDEF0, FLAG_EXTENDED, b"\1\2\3")
    assert node.requests() == [(CAN_REQUEST, 1, 1, 0x1ABCDEF0, FLAG_EXTENDED | 3, 0x030201, 0, None)]


def test_a_buffer_is_free_again_when_the_bus_reports_its_end():
    node = Node(IER=ICR_TI1)
    served = []
    node.chip.vic.attach(CAN_TX_DONE, 1, lambda queue: served.append(node.can.read_ICR()), cost=100)
    assert node.can.GSR() == GSR_TBS | GSR_TCS
    assert node.can.transmit(1, 1, FAST, b"") and not node.can.buffer_free(1)
    assert not node.can.transmit(1, 2, FAST, b"") and node.can.refused == 1
    assert node.can.transmit(3, 2, FAST, b"")
    assert node.can.GSR() == 0
    node.arrives(CAN_TX_DONE, 1, TX_SENT)
    assert node.can.buffer_free(1) and served == [ICR_TI1]
    node.arrives(CAN_TX_DONE, 3, TX_ABORTED)  # its interrupt is not enabled
    assert served == [ICR_TI1] and node.can.read_ICR() == ICR_TI3
    assert (node.can.sent, node.can.aborted, node.can.GSR()) == (1, 1, GSR_TBS)


def test_what_is_received_waits_in_order_and_asks_for_its_interrupt_until_it_is_taken():
    node = Node()
    taken = []

    def take_one(queue):
        taken.append(node.can.receive())

    node.chip.vic.attach(CAN_RX, 1, take_one, cost=10_000)  # 167 us: two more arrive meanwhile
    node.receives(0x10, FAST | 15, bytes(range(64)))
    node.receives(0x11, FLAG_FD | 8, bytes(8))
    node.receives(0x12, 3, b"abc")
    node.chip.advance(node.time + 1_000_000)
    assert taken == [(0x10, FAST | 15, bytes(range(64))), (0x11, FLAG_FD | 8, bytes(8)), (0x12, 3, b"abc")]
    assert node.can.receive() is None and node.can.GSR() & GSR_RBS == 0


def test_a_handler_that_takes_all_is_not_called_for_an_empty_queue():
    node = Node()
    calls = []

    def take_all(queue):
        calls.append(0)
        while node.can.receive() is not None:
            calls[-1] += 1

    node.chip.vic.attach(CAN_RX, 1, take_all, cost=10_000)
    for identifier in range(3):
        node.receives(identifier, FLAG_FD, b"")
    node.chip.advance(node.time + 1_000_000)
    assert calls == [1, 2]


def test_a_frame_that_finds_the_queue_full_is_an_overrun():
    node = Node(IER=0)
    for identifier in range(RECEIVE_FRAMES + 2):
        node.receives(identifier, FLAG_FD, b"")
    assert (node.can.received, node.can.data_overruns) == (RECEIVE_FRAMES, 2)
    assert node.can.GSR() & GSR_DOS and node.can.read_ICR() == ICR_DOI | ICR_RI
    node.can.clear_overrun()
    assert not node.can.GSR() & GSR_DOS
    assert [node.can.receive()[0] for _ in range(RECEIVE_FRAMES)] == list(range(RECEIVE_FRAMES))


def test_only_identifiers_of_the_filter_pass():
    node = Node(IER=0)
    node.can.accept([0x10, (0x20, 0x22)])
    for identifier in (0xF, 0x10, 0x21, 0x23):
        node.receives(identifier, FLAG_FD, b"")
    assert [node.can.receive()[0] for _ in range(2)] == [0x10, 0x21] and node.can.receive() is None
    node.can.accept_all()
    node.receives(0x23, FLAG_FD, b"")
    assert node.can.receive()[0] == 0x23


def test_bus_off_resets_it_and_the_program_restarts_it():
    node = Node()
    node.can.transmit(2, 1, FAST, bytes(12))
    node.requests()
    node.arrives(CAN_STATUS, ICR_ERROR_WARNING, 127, 3, 1)
    assert node.can.GSR() == GSR_TBS | GSR_ES | GSR_BS | 3 << 16 | 127 << 24
    assert not node.can.transmit(2, 1, FAST, bytes(12))
    node.can.write_MOD(0)
    assert node.requests() == [(CAN_MODE, 1, 0, 0, 0, 0, 0, None)]
    node.arrives(CAN_STATUS, 0, 0, 0, 0)
    assert node.can.transmit(2, 1, FAST, bytes(12))
    node.can.abort(2)
    assert node.requests()[1][:3] == (CAN_ABORT, 1, 2)


@pytest.mark.parametrize(
    ("identifier", "flags", "data", "fault"),
    [
        (0x800, FAST, b"", "0x800: identifier 0x800 is above 0x7ff"),
        (1, FAST, bytes(9), "9 data bytes; a CAN FD frame has 0, 1, .*, 48, 64"),
        (1, 0, bytes(9), "9 data bytes; a classic frame has at most 8"),
        (1, FLAG_BRS, b"", "BRS and ESI are bits of CAN FD frames"),
        (1, FAST | FLAG_REMOTE, b"", "CAN FD has no remote frames"),
        (1, FAST | 128, b"", "flags 0x380 cannot be sent"),
    ],
)
def test_a_frame_that_does_not_exist_is_refused_by_name(identifier, flags, data, fault):
    with pytest.raises(UserError, match=f"TEST: CAN FD controller 1: .*{fault}"):
        Node().can.transmit(1, identifier, flags, data)


def test_without_a_data_rate_it_is_a_classic_controller():
    node = Node(bit_rate=500_000, data_bit_rate=0)
    assert node.can.can_rates() is None
    with pytest.raises(UserError, match="started without a data bit rate"):
        node.can.transmit(1, 1, FAST, b"")
    assert node.can.transmit(1, 1, 0, b"")


@pytest.mark.parametrize("rates", [(0, 0), (500_000, 250_000)])
def test_bit_rates_that_do_not_fit_are_refused(rates):
    with pytest.raises(UserError, match="the second, of the data, not lower"):
        CanFdController(Microcontroller("TEST"), 1, *rates)
