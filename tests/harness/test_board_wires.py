"""Where each kind of a board's messages goes: to its buses, its bridge, its link, its lines, or nowhere."""

import array

import pytest

from ranger_sim.can_bus.bus import Bus
from ranger_sim.firmware_sim.board import Board
from ranger_sim.firmware_sim.peripherals.ssp import SspSegment
from ranger_sim.foundation import events
from ranger_sim.foundation.events import EventQueue
from ranger_sim.foundation.row_stream import RowStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.wiring.board_wires import BoardWires, SspWire
from ranger_sim.plant.bridge import Bridge

WINDOW = 10_000
MBIT = 1_000_000


class Seen(Bridge):
    """A bridge that notes what is written to it."""

    def __init__(self):
        self.calls = []

    def write_pwm(self, time, mr2, mr6, mr0):
        self.calls.append(("pwm", time, mr2, mr6, mr0))

    def watchdog_edge(self, time):
        self.calls.append(("watchdog", time))

    def low_side(self, time, enable2, enable6):
        self.calls.append(("low side", time, bool(enable2), bool(enable6)))


class Ends(Board):
    """A board without a program; it runs to `horizon`."""

    def transmit_ends(self, controller):
        return None


class Line:
    """Something outside that receives a board."""

    def __init__(self):
        self.heard = []

    def from_board(self, *what):
        self.heard.append(what)


@pytest.fixture
def wires():
    board = Ends("MCH")
    board.horizon = 1_000_000
    found = BoardWires(board, WINDOW)
    found.connect_drive(Seen(), 7, 2, 6)
    return found


def on_a_bus(wires, controller=1):
    """The bus at a controller of the board, with another node that receives; that one's inbox."""
    bus = Bus("can1", MBIT)
    inboxes = [EventQueue(), EventQueue()]
    nodes = [bus.add_node(name, inbox, 1, 500 + n) for n, (name, inbox) in enumerate(zip("ab", inboxes, strict=True))]
    wires.connect_bus(controller, bus, nodes[0])
    return bus, inboxes[1]


def watched(columns):
    """A row stream and the list of rows that it gives."""
    stream = RowStream("q", columns, False)
    rows = []

    def keep(_time, block):
        numbers = array.array("q", block)
        rows.extend(tuple(numbers[at : at + columns]) for at in range(0, len(numbers), columns))

    stream.sink = keep
    return stream, rows


def test_pins_and_pulse_widths_reach_the_bridge_and_other_pins_do_not(wires):
    for time, pin, level in ((10, 7, 1), (20, 2, 1), (30, 6, 1), (40, 2, 0), (50, 6, 0), (60, 5, 1), (70, 7, 0)):
        wires.push(time, 0, events.PIN_OUTPUT, pin, level)
    wires.push(80, 0, events.PWM_UPDATE, 100, 200, 3000)
    assert wires.drive.calls == [
        ("watchdog", 10),
        ("low side", 20, True, False),
        ("low side", 30, True, True),
        ("low side", 40, False, True),
        ("low side", 50, False, False),
        ("watchdog", 70),
        ("pwm", 80, 100, 200, 3000),
    ]


def test_a_board_without_a_bridge_may_write_to_one():
    wires = BoardWires(Ends("UI"), WINDOW)
    wires.push(10, 0, events.PWM_UPDATE, 1, 2, 3)
    wires.push(10, 0, events.PIN_OUTPUT, 4, 1)


def test_a_frame_goes_to_the_bus_of_its_controller_and_shortens_the_turn(wires):
    bus, received = on_a_bus(wires, controller=3)
    wires.push(5_000, 0, events.CAN_REQUEST, 3, 2, 0x123, 8, 1, 2)
    assert wires.board.horizon == 5_000 + WINDOW
    bus.advance(1_000_000)
    assert received.take() and (received.kind, received.b, received.c, received.d, received.e) == (
        events.CAN_RX,
        0x123,
        8,
        1,
        2,
    )
    wires.push(6_000, 0, events.CAN_REQUEST, 1, 1, 0x124, 8, 1, 2)  # leads nowhere
    bus.advance(2_000_000)
    assert not received.take()
    wires.board.horizon = 100
    wires.push(2_000_001, 0, events.CAN_REQUEST, 3, 1, 0x125, 8, 0, 0)
    assert wires.board.horizon == 100  # it stops before that anyway


def test_a_frame_is_taken_back_and_a_controller_reset_and_set_going(wires):
    bus, received = on_a_bus(wires)
    wires.push(0, 0, events.CAN_REQUEST, 1, 1, 0x100, 8, 0, 0)
    wires.push(0, 0, events.CAN_REQUEST, 1, 2, 0x101, 8, 0, 0)
    wires.push(10, 0, events.CAN_ABORT, 1, 2)
    bus.advance(1_000_000)
    assert (bus.counters.aborted, bus.counters.frames) == (1, 1)
    wires.push(1_000_001, 0, events.CAN_MODE, 1, 1)
    bus.advance(1_000_100)
    assert bus.operating == 1
    wires.push(1_000_200, 0, events.CAN_MODE, 1, 0)
    bus.advance(2_000_000)
    assert bus.operating == 2


def test_what_is_for_a_bus_outside_goes_there_whole(wires):
    line = wires.can_lines[2] = Line()
    wires.push(1, 0, events.CAN_REQUEST, 2, 3, 4, 5, 6, 7)
    wires.push(2, 0, events.CAN_ABORT, 2, 3)
    wires.push(3, 0, events.CAN_MODE, 2, 1)
    assert line.heard == [
        (events.CAN_REQUEST, 1, 3, 4, 5, 6, 7),
        (events.CAN_ABORT, 2, 3, 0, 0, 0, 0),
        (events.CAN_MODE, 3, 1, 0, 0, 0, 0),
    ]
    assert wires.board.horizon == 1_000_000  # nothing comes back from there within the turn


def test_a_controller_moves_from_one_bus_to_another_and_off_it(wires):
    first, _ = on_a_bus(wires)
    second, received = on_a_bus(wires)
    wires.push(0, 0, events.CAN_REQUEST, 1, 1, 0x100, 8, 0, 0)
    first.advance(1_000_000)
    second.advance(1_000_000)
    assert (first.counters.frames, second.counters.frames) == (0, 1)
    wires.connect_bus(1, None, -1)
    wires.push(1_000_001, 0, events.CAN_REQUEST, 1, 1, 0x100, 8, 0, 0)
    second.advance(2_000_000)
    assert second.counters.frames == 1
    with pytest.raises(UserError, match="MCH: 'can1' is not a Bus"):
        wires.connect_bus(1, "can1", 0)


def test_a_board_sends_no_sooner_than_its_schedule_says(wires):
    on_a_bus(wires)
    wires.silent_until = 5_000
    with pytest.raises(UserError, match="MCH: a frame was sent at 4999 ns, .* none could be before 5000 ns"):
        wires.request(4_999, 1, 1, 0x100, 8, 0, 0)
    wires.request(5_000, 1, 1, 0x100, 8, 0, 0)


def test_bytes_go_to_the_line_of_their_uart(wires):
    line = wires.serial_lines[1] = Line()
    wires.push(7, 0, events.UART_OUTPUT, 1, 65, 2, ref=b"ab")
    wires.push(8, 0, events.UART_OUTPUT, 0, 66, 1)
    assert line.heard == [(7, 65, 2, b"ab")]


def test_what_is_watched_are_pins_and_pulse_widths_alone(wires):
    on_a_bus(wires)
    wires.watch, rows = watched(5)
    wires.push(10, 0, events.PIN_OUTPUT, 2, 1, 9)
    wires.push(20, 0, events.PWM_UPDATE, 1, 2, 3)
    wires.push(30, 0, events.CAN_REQUEST, 1, 1, 0x100, 8, 0, 0)
    wires.watch.flush()
    assert rows == [(10, events.PIN_OUTPUT, 2, 1, 9), (20, events.PWM_UPDATE, 1, 2, 3)]


# ---- the link between two boards


def segment(*frames):
    """A segment with so many frames: (header, first word, second word) each."""
    found = SspSegment()
    half_words = []
    for header, first, second in frames:
        half_words += [header, first >> 16, first & 0xFFFF, second >> 16, second & 0xFFFF]
    found.words = [*half_words, *[0] * (31 - len(half_words))]
    found.used = len(half_words)
    return found


def exchanged(board):
    """[(time, order, segment)] in a board's inbox."""
    found = []
    while board.inbox.take():
        assert board.inbox.kind == events.SSP_SEGMENT
        found.append((board.inbox.time, board.inbox.order, board.inbox.ref))
    return found


def test_an_exchange_gives_each_side_what_the_other_had_loaded_at_its_end(wires):
    master, slave = wires.board, Ends("CSR")
    idle, first, second = segment(), segment((1, 2, 3)), segment((4, 5, 6))
    wires.link = SspWire(master, slave, 2_000, idle)
    wires.push(100, 0, events.SSP_START, ref=first)
    assert wires.board.horizon == 100 + 2_000 + WINDOW
    wires.push(200, 0, events.SSP_LOAD, ref=second)
    wires.push(5_000, 0, events.SSP_START, ref=first)
    order = events.ORDER_INTERRUPTS
    assert exchanged(slave) == [(2_100, order, first), (7_000, order, first)]
    assert exchanged(master) == [(2_100, order, idle), (7_000, order, second)]
    assert wires.link.exchanges == 2


def test_a_fault_on_the_link_changes_or_swallows_what_arrives(wires):
    master, slave = wires.board, Ends("CSR")
    idle, sent, false = segment(), segment((1, 2, 3)), segment((9, 9, 9))
    wires.link = SspWire(master, slave, 2_000, idle)

    class Tampering:
        def exchange(self, end, to_slave, to_master):
            assert (end, to_slave, to_master) == (2_100, sent, idle)
            return false, None

    wires.link.tampering = Tampering()
    wires.push(100, 0, events.SSP_START, ref=sent)
    assert exchanged(slave) == [(2_100, events.ORDER_INTERRUPTS, false)] and exchanged(master) == []


def test_a_row_is_noted_for_each_frame_of_both_segments():
    master, slave = Ends("MB"), Ends("CSR")
    link = SspWire(master, slave, 2_000, segment((7, 8, 9)))
    link.watch, rows = watched(5)
    link.start(100, segment((1, 2, 3), (4, 5, 6)))
    link.load(segment())
    link.start(300, segment(*[(n, n, n) for n in range(6)]))
    link.watch.flush()
    assert rows == [
        (100, 0, 1, 2, 3),
        (100, 0, 4, 5, 6),
        (100, 1, 7, 8, 9),
        *((300, 0, n, n, n) for n in range(6)),
    ]
