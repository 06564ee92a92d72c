"""The program's side of a bus: links, attached and private, python-can's interface, and what its benchmark counts."""

import os
import select
import socket
import struct
import sys
from types import SimpleNamespace

import can
import pytest

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge import attached_link, benchmark, paced, python_can
from ranger_sim.can_bus.edge.attached_link import AttachedLink, channels_of, handshake
from ranger_sim.can_bus.edge.links import Link, LinkError, QueueFullError
from ranger_sim.can_bus.edge.paced import PacedBus, alone_and_passive, hold_off, is_quiet
from ranger_sim.can_bus.edge.private_link import PrivateBus, PrivateLink
from ranger_sim.can_bus.edge.python_can import message_of_event
from ranger_sim.can_bus.edge.taps import DROPPED, ERROR_PASSIVE, LISTENING, OFF, RECEIVED, SENT, STATE
from ranger_sim.can_bus.node import RESET
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE, NEVER, STAGE_BUS, EventQueue
from ranger_sim.foundation.user_error import UserError

from . import bit_oracle as oracle
from .hosting import fresh_name

MS, SECOND = 1_000_000, 1_000_000_000
OVERFLOW_FRAME = (0x4, 8 | FLAG_ERROR, 0x0100, 0)  # linux/can/error.h: a controller whose receive buffer ran over


def frame(kind, number, time=0):
    return (kind, time, number, 0, 0, 0)


# ---- what every link does


@pytest.mark.parametrize("own", [False, True])
def test_events_are_kept_or_counted_by_their_kind(own):
    link = Link("here", own, 100)
    assert (link.state, link.counters, link.closed, link.signal, list(link.arrived)) == (0, (0, 0), False, -1, [])
    assert (link.lost_frames, link.missed_frames, link.dropped_frames, link.sent_frames) == (0, 0, 0, 0)
    for event in (frame(RECEIVED, 1), frame(SENT, 2), frame(DROPPED, 3), (STATE, 9, ERROR_PASSIVE, 128, 7, 0)):
        link._arrive(event)
    assert list(link.arrived) == [frame(RECEIVED, 1)] + ([frame(SENT, 2)] if own else [])
    assert (link.lost_frames, link.dropped_frames, link.sent_frames) == (0, 1, 1)
    assert (link.state, link.counters) == (ERROR_PASSIVE, (128, 7))
    assert link._take() == frame(RECEIVED, 1)
    if own:
        assert link._take() == frame(SENT, 2)
    assert link._take() is None


def test_a_reader_that_is_too_slow_loses_the_latest_frames_and_gets_a_report_before_the_next():
    link = Link("here", False, 2)
    for number in range(5):
        link._arrive(frame(RECEIVED, number))
    assert link.lost_frames == 3
    assert link._take() == frame(RECEIVED, 0)
    link._arrive(frame(RECEIVED, 5, time=77))
    assert list(link.arrived) == [frame(RECEIVED, 1), (RECEIVED, 77, *OVERFLOW_FRAME), frame(RECEIVED, 5, time=77)]
    assert link.lost_frames == 3
    link._take()
    link._take()
    link._arrive(frame(RECEIVED, 6))
    assert list(link.arrived) == [frame(RECEIVED, 5, time=77), frame(RECEIVED, 6)]


def readable(number):
    return bool(select.select([number], [], [], 0)[0])


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="eventfd")
def test_a_descriptor_is_readable_while_something_is_there():
    link = Link("here", False, 9)
    link._arrive(frame(RECEIVED, 1))
    link._make_signal()
    signal = link.signal
    assert readable(signal)
    link._arrive(frame(RECEIVED, 2))
    link._raise_signal()
    link._take()
    assert readable(signal)
    link._take()
    assert not readable(signal) and link._take() is None
    link._raise_signal()  # nothing is there
    assert not readable(signal)
    link._close_signal()
    assert link.signal == -1
    link._close_signal()
    with pytest.raises(OSError):
        os.fstat(signal)


def test_other_systems_have_no_such_descriptor(monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    with pytest.raises(NotImplementedError):
        Link("here", False, 9)._make_signal()


def test_a_full_queue_is_reported_with_the_counters_of_a_controller_that_is_not_well():
    link = Link("here", False, 9)
    assert str(link._full()) == "here: the transmit queue stayed full"
    link.state, link.counters = ERROR_PASSIVE, (128, 0)
    assert "error passive, counters (128, 0)" in str(link._full()) and isinstance(link._full(), QueueFullError)


# ---- greetings

WELCOME = struct.pack("<IBHHIq", 17 + 9, 2, 1, 64, 500_000, 77) + b"can1\ncan2"


class Answering:
    """The other end: gives these pieces, then raises or ends."""

    def __init__(self, *pieces):
        self.pieces, self.said, self.closed, self.timeout = list(pieces), b"", False, "as it was"

    def sendall(self, data):
        self.said += data

    def recv(self, _limit):
        piece = self.pieces.pop(0) if self.pieces else b""
        if isinstance(piece, Exception):
            raise piece
        return piece

    def settimeout(self, seconds):
        self.timeout = seconds

    def close(self):
        self.closed = True


def greet(monkeypatch, other, **options):
    asked = []
    monkeypatch.setattr(attached_link, "connected", lambda *what: asked.append(what) or other)
    found = handshake("name", "can2", **options)
    assert asked[0][0] == "\0ranger-sim/name" and asked[0][2] == options.get("patience_s", 60.0)
    return found


@pytest.mark.parametrize("cut", [3, 5, 20, len(WELCOME)])
def test_a_welcome_may_come_in_pieces_with_more_behind_it(monkeypatch, cut):
    other = Answering(WELCOME[:cut], WELCOME[cut:] + b"more") if cut < len(WELCOME) else Answering(WELCOME + b"more")
    connection, welcome = greet(monkeypatch, other, options=1, patience_s=5.0)
    assert connection is other and welcome == (1, 64, 500_000, 77, ["can1", "can2"], bytearray(b"more"))
    assert other.said == struct.pack("<IB4sHH", 13, 1, b"RNGR", 1, 1) + b"can2"
    assert (other.closed, other.timeout) == (False, None)


@pytest.mark.parametrize(
    ("pieces", "words"),
    [
        ([], "'name' ended the connection without a message"),
        ([struct.pack("<IB", 4, 3) + b"why"], "why"),
        ([struct.pack("<IB", 1, 5)], "'name' does not speak the attach protocol"),
        ([struct.pack("<IBHHI", 9, 2, 1, 64, 5)], "'name' does not speak the attach protocol"),
        ([b"HTTP/1.1"], "'name' does not speak the attach protocol: a record of .* bytes"),
        ([WELCOME[:7], TimeoutError()], "'name' is running but has not answered for 5 s"),
        ([OSError(104, "Connection reset by peer")], "attaching to 'name': Connection reset by peer"),
    ],
)
def test_a_server_without_a_handshake_is_reported_and_left(monkeypatch, pieces, words):
    other = Answering(*pieces)
    with pytest.raises(UserError, match=f"^{words}"):
        greet(monkeypatch, other, patience_s=5.0)
    assert other.closed


def test_an_absent_server_is_a_missing_file_and_other_failures_are_the_users(monkeypatch):
    def failing(error):
        def connected(*_):
            raise error

        monkeypatch.setattr(attached_link, "connected", connected)

    failing(ConnectionRefusedError(111, "Connection refused"))
    with pytest.raises(FileNotFoundError, match="name"):
        handshake("name", "can1")
    failing(OSError(1, "Operation not permitted"))
    with pytest.raises(UserError, match="^attaching to 'name': Operation not permitted$"):
        handshake("name", "can1")


def test_a_client_that_only_asks_for_channels_leaves(monkeypatch):
    other = Answering(WELCOME)
    monkeypatch.setattr(attached_link, "connected", lambda *_: other)
    assert channels_of("name") == ["can1", "can2"] and other.closed
    assert other.said == struct.pack("<IB4sHH", 9, 1, b"RNGR", 1, 0)


# ---- an attached link


class Attached:
    """A link with window 2, and the other end of its connection."""

    def __init__(self, monkeypatch, rest=b"", **options):
        ours, self.end = socket.socketpair()
        self.greetings = []

        def handshake(name, channel, asked):
            self.greetings.append((name, channel, asked))
            return ours, (1, 2, 500_000, 77, ["can1"], bytearray(rest))

        monkeypatch.setattr(attached_link, "handshake", handshake)
        self.link = AttachedLink("name", "can1", **options)
        self.end.setblocking(False)

    def got(self):
        try:
            return self.end.recv(4096)
        except BlockingIOError:
            return b""


@pytest.fixture
def attached(monkeypatch):
    made = []

    def make(rest=b"", **options):
        made.append(Attached(monkeypatch, rest, **options))
        return made[-1].link, made[-1].end, made[-1]

    yield make
    for each in made:
        each.link.close()
        each.end.close()


def record(kind, layout, *values):
    body = struct.pack("<" + layout, *values)
    return struct.pack("<IB", 1 + len(body), kind) + body


def frame_record(kind, number, time=0):
    return record(kind, "qIHII", time, number, 0, 0, 0)


def test_a_link_keeps_the_welcome_and_the_bytes_behind_it(attached):
    link, _, made = attached(frame_record(5, 7, time=3) + frame_record(5, 8)[:4], queue_limit=5)
    assert made.greetings == [("name", "can1", 0)]
    assert (link.label, link.window, link.bitrate, link.epoch_ns, link.channels) == (
        "name/can1",
        2,
        500_000,
        77,
        ["can1"],
    )
    assert (link.state, link.outstanding, link.queue_limit, link.receive_own) == (0, 0, 5, False)
    assert list(link.arrived) == [frame(RECEIVED, 7, time=3)] and len(link.incoming) == 4
    listening, _, made = attached(listen_only=True, receive_own=True)
    assert made.greetings == [("name", "can1", 1)] and listening.state == LISTENING and listening.receive_own


def test_frames_go_out_up_to_the_window_and_on_as_they_are_answered(attached):
    link, end, made = attached()
    link.send(0x123, 2, 0xBBAA, 0, None)
    link.send(0x124, 0, 0, 0, 0.0)
    assert made.got() == record(4, "IHII", 0x123, 2, 0xBBAA, 0) + record(4, "IHII", 0x124, 0, 0, 0)
    assert link.outstanding == 2
    with pytest.raises(QueueFullError, match="^name/can1: the transmit queue stayed full"):
        link.send(0x125, 0, 0, 0, 0.0)
    end.send(frame_record(6, 0x123) + frame_record(7, 0x124))
    link.send(0x125, 0, 0, 0, 0.0)
    assert (link.outstanding, link.sent_frames, link.dropped_frames) == (1, 1, 1)
    assert made.got() == record(4, "IHII", 0x125, 0, 0, 0) and not link.arrived


def test_a_sender_without_acknowledgement_and_limit_gets_an_error(attached, monkeypatch):
    monkeypatch.setattr(attached_link, "UNHEARD_S", 0.0)
    link, end, _ = attached()
    link.send(1, 0, 0, 0, None)
    link.send(2, 0, 0, 0, None)
    end.send(record(8, "qHHH", 5, ERROR_PASSIVE, 128, 0))
    with pytest.raises(QueueFullError, match="counters \\(128, 0\\)"):
        link.send(3, 0, 0, 0, None)
    end.send(frame_record(6, 1))
    link.send(3, 0, 0, 0, None)
    assert link.outstanding == 2


@pytest.mark.parametrize(("state", "words"), [(OFF, "bus-off, nothing can be sent"), (LISTENING, "listening only")])
def test_a_client_that_is_off_or_listens_sends_nothing_until_the_other_side_allows_it(attached, state, words):
    link, end, made = attached()
    end.send(record(8, "qHHH", 5, state, 3, 4))
    assert link.present_state() == state and link.counters == (3, 4)
    with pytest.raises(LinkError, match=f"^name/can1: {words}"):
        link.send(1, 0, 0, 0, None)
    assert made.got() == b"" and link.outstanding == 0
    end.send(record(8, "qHHH", 5, 0, 0, 0))
    link.send(1, 0, 0, 0, None)
    assert link.outstanding == 1 and link.state == 0


def test_what_a_program_wants_of_its_controller_is_one_byte(attached):
    link, _, made = attached()
    for wish, number in ((link.activate, 1), (link.listen, 2), (link.flush, 3)):
        wish()
        assert made.got() == bytes([2, 0, 0, 0, 9, number])


def test_frames_arrive_in_their_order_and_a_missing_stretch_is_reported_with_its_count(attached):
    link, end, _ = attached()
    assert link.receive(0.0) is None
    end.send(frame_record(5, 1, time=7) + record(10, "qQ", 8, 44) + frame_record(5, 2))
    assert link.receive(None) == frame(RECEIVED, 1, time=7) and link.missed_frames == 44
    assert link.receive(0.0) == (RECEIVED, 8, *OVERFLOW_FRAME) and link.receive(0.0) == frame(RECEIVED, 2)
    assert link.receive(0.0) is None and link.receive(-1.0) is None


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (b"", "the other side has gone$"),
        (struct.pack("<IB", 4, 3) + b"why", "why$"),
        (struct.pack("<IB", 0, 3), "the other side does not speak the attach protocol: a record of 0 bytes"),
        (
            struct.pack("<IB", 2, 5) + b"x",
            "the other side does not speak the attach protocol: a body of 1 bytes is too short for a frame",
        ),
        (struct.pack("<IB", 2, 8) + b"x", "the other side does not speak the attach protocol: a body of 1 bytes"),
        (struct.pack("<IB", 1, 66), "the other side does not speak the attach protocol: record type 66 with 0 bytes"),
    ],
)
def test_when_the_other_side_is_gone_earlier_frames_are_still_received(attached, said, words):
    link, end, _ = attached()
    end.send(frame_record(5, 1) + said)
    end.close()
    assert link.receive(None) == frame(RECEIVED, 1)
    for _ in range(2):
        with pytest.raises(LinkError, match=f"^name/can1: {words}"):
            link.receive(None)
    with pytest.raises(LinkError, match=f"^name/can1: {words}"):
        link.send(1, 0, 0, 0, None)
    with pytest.raises(LinkError, match=f"^name/can1: {words}"):
        link.activate()
    assert link.present_state() == 0


def test_writing_to_a_closed_link_gives_the_reason_if_it_was_sent(attached):
    link, end, _ = attached()
    end.send(struct.pack("<IB", 4, 3) + b"why")
    end.close()
    with pytest.raises(LinkError, match="^name/can1: why$"):
        link.send(1, 0, 0, 0, None)
    link, end, _ = attached()
    end.close()
    with pytest.raises(LinkError, match="^name/can1: the other side has gone"):
        link.flush()


def test_a_link_that_is_shut_reports_it_and_is_shut_once(attached):
    link, end, _ = attached()
    number = link.fileno()
    assert link.fileno() == number and not readable(number)
    end.send(frame_record(5, 1) + frame_record(5, 2))
    assert readable(number)
    link.receive(0.0)
    assert readable(number)  # the second is here already
    link.receive(0.0)
    assert not readable(number)
    link.close()
    link.close()
    assert link.signal == -1 and end.recv(10) == b""
    for action in (lambda: link.receive(None), lambda: link.send(1, 0, 0, 0, None), link.listen):
        with pytest.raises(LinkError, match="^name/can1: is shut down$"):
            action()
    assert link.present_state() == 0


def test_figures_of_an_attached_bus_are_those_of_what_has_come_by_now(attached):
    link, end, _ = attached()
    end.send(frame_record(6, 1) + record(8, "qHHH", 5, 0, 3, 4))
    reported = python_can.RangerSimBus.statistics(SimpleNamespace(_link=link))
    assert (reported["sent"], reported["transmit_errors"], reported["receive_errors"]) == (1, 3, 4)


# ---- private links


@pytest.fixture
def clock(monkeypatch):
    now = [0]
    monkeypatch.setattr(wallclock, "monotonic_ns", lambda: now[0])
    monkeypatch.setattr(wallclock, "epoch_ns", lambda: 5 * SECOND)
    return now


def private(count=2, speed=0.0, depth=64, **options):
    bus = PrivateBus(PacedBus("can1", speed=speed, depth=depth))
    found = [PrivateLink(bus, f"link {number}", **options) for number in range(count)]
    assert bus.links == found
    return found


def test_private_links_receive_each_other_with_stamps_since_the_epoch(clock):
    one, two = private()
    assert (one.bitrate, one.state, one.label) == (1_000_000, 0, "link 0")
    one.send(0x123, 3, 0x030201, 0, None)
    [time, *words] = two.receive(0.0)[1:]
    assert words == [0x123, 3, 0x030201, 0] and 5 * SECOND + 60_000 < time < 5 * SECOND + 120_000
    assert one.receive(0.0) is None and one.sent_frames == 1
    two.close()
    one.close()
    assert one.bus.links == []


class Waking:
    """A condition of a link, which notes that its threads wake."""

    def __init__(self, link, woken, number):
        self.link, self.woken, self.number = link, woken, number

    def __enter__(self):
        self.link.bus.lock.acquire()

    def __exit__(self, *_):
        self.link.bus.lock.release()

    def notify_all(self):
        self.woken.append(self.number)


def test_threads_of_every_link_wake_when_the_next_event_comes_nearer_and_only_then(clock):
    """Each sleeps until the next event; a sender's own reader is one of them."""
    links_of_bus = private(3, speed=1.0)
    woken = []
    for number, link in enumerate(links_of_bus):
        link.changed = Waking(link, woken, number)
    links_of_bus[1].send(0x123, 0, 0, 0, None)  # from never to the frame's end
    assert woken == [0, 1, 2]
    links_of_bus[0].send(0x124, 0, 0, 0, None)  # behind that frame
    assert woken == [0, 1, 2]


def test_a_private_queue_that_stays_full_and_a_controller_that_is_off_are_reported(clock):
    [one] = private(1, depth=3)
    for number in range(3):
        one.send(number, 0, 0, 0, 0.0)
    with pytest.raises(QueueFullError, match="link 0: the transmit queue stayed full"):
        one.send(4, 0, 0, 0, 0.0)
    with pytest.raises(QueueFullError, match="acknowledge=True adds a silent node"):
        one.send(4, 0, 0, 0, None)
    one.flush()
    assert one.dropped_frames == 3 and one.tap.queued == 0
    one.listen()
    assert one.present_state() == LISTENING
    with pytest.raises(LinkError, match="link 0: listening only"):
        one.send(4, 0, 0, 0, None)
    one.activate()
    one.tap.off = True
    assert one.present_state() == OFF
    with pytest.raises(LinkError, match="link 0: bus-off"):
        one.send(4, 0, 0, 0, None)
    one.tap.off = False
    while one.receive(0.0) is not None:  # error frames, for each missing acknowledgement
        pass
    one.close()
    for action in (
        lambda: one.receive(0.0),
        lambda: one.send(1, 0, 0, 0, None),
        one.flush,
        one.listen,
        one.activate,
        one.fileno,
    ):
        with pytest.raises(LinkError, match="link 0: is shut down"):
            action()
    one.close()
    assert one.present_state() == ERROR_PASSIVE


def test_a_private_link_may_begin_by_listening_and_get_its_own_frames(clock):
    bus = PrivateBus(PacedBus("can1", speed=0.0))
    quiet = PrivateLink(bus, "quiet", listen_only=True)
    own = PrivateLink(bus, "own", receive_own=True, queue_limit=1)
    other = PrivateLink(bus, "other")
    assert quiet.present_state() == LISTENING and quiet.tap.controller.silent
    own.send(1, 0, 0, 0, None)
    own.send(2, 0, 0, 0, None)
    assert own.receive(0.0)[:3:2] == (SENT, 1) and own.lost_frames == 1 and own.sent_frames == 2
    assert [quiet.receive(0.0)[2] for _ in range(2)] == [other.receive(0.0)[2] for _ in range(2)] == [1, 2]
    number = own.fileno()
    assert not readable(number) and own.pump is None and own.fileno() == number
    other.send(3, 0, 0, 0, None)
    assert readable(number)
    for link in (quiet, own, other):
        link.close()


# ---- a bus of its own clock


@pytest.mark.parametrize(
    ("changes", "alone"),
    [
        ({}, True),
        ({"waiting": False}, False),
        ({"acknowledging": 2}, False),
        ({"disturbed": True}, False),
        ({"joining": 1}, False),
        ({"command": True}, False),
        ({"strike": True}, False),
        ({"frames": 1}, False),
        ({"passive": False}, False),
    ],
)
def test_a_passive_sender_without_receivers_is_alone(changes, alone):
    bus = Bus("can1", 1_000_000)
    for number in range(3):
        bus.add_node(f"n{number}", EventQueue(8), 1, STAGE_BUS * 256 + number)
    bus.nodes[0].passive = changes.get("passive", True)
    if changes.get("waiting", True):
        bus.request(0, 1, 0, 1, 0, 0, 0)
    bus.acknowledging = changes.get("acknowledging", 1)
    bus.disturbed = changes.get("disturbed", False)
    bus.joining = changes.get("joining", 0)
    if changes.get("command"):
        bus.commands.push(5, 0, 1, 0, 1)
    if changes.get("strike"):
        bus.strike_bit = 9
    bus.disturbance.frames_left = changes.get("frames", 0)
    assert alone_and_passive(bus) == alone


def test_a_bus_is_quiet_but_for_noise():
    bus = Bus("can1", 1_000_000)
    for number in range(2):
        bus.add_node(f"n{number}", EventQueue(8), 1, STAGE_BUS * 256 + number)
    assert is_quiet(bus)
    bus.set_bit_error_rate(1e-3)
    assert is_quiet(bus)
    bus.inject_error_at(5 * MS)
    assert not is_quiet(bus)
    bus.disturbance.planned_bits.clear()
    for name in ("joining", "disturbed"):
        setattr(bus, name, 1)
        assert not is_quiet(bus)
        setattr(bus, name, 0)
    bus.set_mode(1, RESET, 10)
    assert not is_quiet(bus)
    bus.advance(10)
    assert is_quiet(bus)
    bus.request(0, 1, 20, 1, 0, 0, 0)
    assert not is_quiet(bus)


def test_what_waits_is_held_off_until_a_bit():
    bus = Bus("can1", 1_000_000)
    for number in range(2):
        bus.add_node(f"n{number}", EventQueue(8), 1, STAGE_BUS * 256 + number)
    bus.request(0, 1, 0, 1, 0, 0, 0)
    bus.request(1, 1, 900_000, 2, 0, 0, 0)
    hold_off(bus, 500)
    assert (bus.next_bit, bus.next_time) == (500, 500_000)
    assert [bus.buffers.rows[row + 1] for row in (1 << 3, 1 << 5 | 1 << 3)] == [500, 901]
    hold_off(bus, 400)
    assert (bus.next_bit, bus.next_time) == (500, 500_000)


def test_a_paced_bus_is_made_of_its_options(clock):
    clock[0] = 7
    bus = PacedBus("can9", 250_000, 0.5, 3, 1e-3, 5)
    assert (bus.channel, bus.bitrate, bus.speed, bus.bit_error_rate, bus.time) == ("can9", 250_000, 0.5, 1e-3, 0)
    assert (bus.bus.name, bus.bus.bitrate, bus.taps.depth, bus.bus.log.capacity) == ("can9", 250_000, 5, 0)
    assert (bus.started_ns, bus.epoch_ns, bus.bus.disturbance.bit_error_rate) == (7, 5 * SECOND, 1e-3)
    plain = PacedBus("can1")
    assert (plain.bitrate, plain.speed, plain.bit_error_rate, plain.taps.depth) == (1_000_000, 1.0, 0.0, 64)
    with pytest.raises(UserError, match="bit error rate 0.2 is outside"):
        PacedBus("can1", bit_error_rate=0.2)


def test_by_the_clock_time_passes_in_any_case_and_a_call_returns_the_next_time(clock):
    bus = PacedBus("can1", speed=2.0)
    sender, other = bus.add("a"), bus.add("b")
    clock[0] = MS
    assert bus.advance() == NEVER and bus.time == 2 * MS
    sender.offer(1, 0, 0, 0)
    following = bus.advance()
    assert following == 2 * MS + 1_000 and bus.seconds_until(following) == pytest.approx(0.5e-6)
    clock[0] += 1_000  # two bits
    following = bus.advance()
    bits = len(oracle.stuffed(oracle.Frame(1))[0]) + 10
    assert not other.received and following == 2 * MS + 1_000 + (bits - 1) * 1_000
    clock[0] += 100_000
    assert bus.advance() == NEVER and (sender.sent, other.received) == (1, 1)
    assert bus.time == bus.now() == 2 * MS + 202_000
    assert bus.seconds_until(bus.now() - 1) == 0.0


def test_a_call_passes_a_bounded_number_of_events_and_returns_with_more_to_do(clock, monkeypatch):
    monkeypatch.setattr(paced, "BURST", 3)
    bus = PacedBus("can1", speed=0.0)
    sender, other = bus.add("a"), bus.add("b")
    for number in range(9):
        sender.offer(number, 0, 0, 0)
    calls = 0
    while (following := bus.advance()) <= bus.time:
        calls += 1
        assert following == bus.time
    assert calls > 2 and following == NEVER and other.received == 9


# ---- python-can


@pytest.mark.parametrize(
    ("event", "fields"),
    [
        ((RECEIVED, 1_500_000_000, 0x123, 3, 0x030201, 9), (1.5, 0x123, False, False, False, 3, b"\1\2\3", True)),
        (
            (SENT, 0, 0x1ABCDEF0, 5 | FLAG_EXTENDED, 1, 0xFF02),
            (0.0, 0x1ABCDEF0, True, False, False, 5, b"\1\0\0\0\2", False),
        ),
        ((RECEIVED, 0, 0x1, 6 | FLAG_REMOTE, 0, 0), (0.0, 1, False, True, False, 6, b"", True)),
        ((RECEIVED, 0, 0x1, 15, 1, 2), (0.0, 1, False, False, False, 8, b"\1\0\0\0\2\0\0\0", True)),
        (
            (RECEIVED, 0, 0x204, 8 | FLAG_ERROR, 0x0100, 3),
            (0.0, 0x204, False, False, True, 8, b"\0\1\0\0\3\0\0\0", True),
        ),
    ],
)
def test_an_event_becomes_its_message(event, fields):
    message = message_of_event(event, "here")
    assert fields == (
        message.timestamp, message.arbitration_id, message.is_extended_id, message.is_remote_frame,
        message.is_error_frame, message.dlc, bytes(message.data), message.is_rx,
    )  # fmt: skip
    assert message.channel == "here"


@pytest.mark.parametrize(
    ("value", "truth"),
    [(True, True), (False, False), (1, True), (0, False), (None, False), ("1", True), (" TRUE ", True), ("yes", True),
     ("On", True), ("0", False), ("no", False), ("", False), ("2", False)],
)  # fmt: skip
def test_truth_has_four_spellings(value, truth):
    assert python_can._truth(value) is truth


@pytest.mark.parametrize(("value", "number"), [("3", 3), (7, 7), (5.0, 5)])
def test_whole_numbers_are_taken_within_their_limits(value, number):
    assert python_can._whole("n", value, 3, 7) == number


@pytest.mark.parametrize("value", [2, 8, "x", None, "3.5"])
def test_other_numbers_are_refused_with_their_limits(value):
    with pytest.raises(UserError, match=f"^ranger_sim: n {value!r} is not a whole number in 3 ... 7$"):
        python_can._whole("n", value, 3, 7)


@pytest.fixture
def opened():
    made = []

    def make(channel=None, **options):
        options.setdefault("private", True)
        made.append(python_can.RangerSimBus(channel or name, **options))
        return made[-1]

    name = fresh_name()
    yield make
    for each in made:
        each.shutdown()


def test_a_bus_reports_its_name_and_the_counts_of_its_frames(opened):
    one = opened(speed="max", bitrate="250000")
    two = opened(receive_own_messages="yes")
    assert (one.bitrate, two.bitrate) == (250_000, 250_000) and one.channel == two.channel
    assert "private bus" in one.channel_info and "250000 bit/s" in one.channel_info
    for number in range(3):
        two.send(can.Message(arbitration_id=number, is_extended_id=False))
    names = ("sent", "dropped", "lost", "missed", "transmit_errors", "receive_errors")
    assert one.statistics() == dict.fromkeys(names, 0)
    assert two.statistics() == dict.fromkeys(names, 0) | {"sent": 3}
    link = two._link
    link.dropped_frames, link.lost_frames, link.missed_frames, link.counters = 2, 3, 4, (5, 6)
    assert two.statistics() == dict(zip(names, (3, 2, 3, 4, 5, 6), strict=True))
    own = two.recv(0)
    assert (own.is_rx, one.recv(0).is_rx, own.channel) == (False, True, two.channel)


def test_states_can_be_ordered_except_for_the_one_that_cannot_be_chosen(opened):
    one = opened(speed="max")
    assert one.state == can.BusState.ACTIVE
    one.state = can.BusState.PASSIVE
    assert one.state == can.BusState.PASSIVE and one._link.tap.silent
    one.state = can.BusState.ACTIVE
    assert one.state == can.BusState.ACTIVE and not one._link.tap.silent
    with pytest.raises(ValueError, match="cannot be ordered into"):
        one.state = can.BusState.ERROR
    one._link.tap.off = True
    assert one.state == can.BusState.ERROR
    one._link.tap.off = False
    one._link.tap.counters = (128, 0)
    assert one.state == can.BusState.PASSIVE


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"channel": "robot/can1"}, "private=True and the name of a robot, 'robot', exclude each other"),
        ({"robot": "other"}, "private=True and the name of a robot, 'other', exclude each other"),
        ({"channel": "robot/"}, "no channel was given"),
        ({"fd": "yes", "data_bitrate": 999}, "data_bitrate 999 is not a whole number in 1000 ... 100000000"),
        ({"bitrate": 999}, "bitrate 999 is not a whole number in 1000 ... 100000000"),
        ({"bitrate": "fast"}, "bitrate 'fast' is not a whole number"),
        ({"rx_queue_size": 0}, "rx_queue_size 0 is not a whole number in 1 ... 100000000"),
        ({"speed": "slow"}, "speed 'slow' is neither"),
        ({"seed": "x"}, "invalid literal"),
        ({"bit_error_rate": 0.5}, "bit error rate 0.5 is outside"),
    ],
)
def test_a_mistake_when_opening_is_pythons_cans_initialization_error(opened, options, words):
    with pytest.raises(can.CanInitializationError, match=words):
        opened(**options)


def test_the_first_to_open_a_private_bus_sets_its_options(opened):
    opened(speed="max", bitrate=500_000, bit_error_rate=0.01, seed=4)
    assert opened(speed="max", bitrate=500_000, bit_error_rate="0.01").bitrate == 500_000
    for options, words in (
        ({"bitrate": 250_000}, "open with bitrate 500000, not 250000"),
        ({"speed": 1.0}, "open with speed 0, not 1"),
        ({"bit_error_rate": 0.02}, "open with bit_error_rate 0.01, not 0.02"),
    ):
        with pytest.raises(can.CanInitializationError, match=words):
            opened(**options)


def test_a_timing_has_the_bit_rate(opened):
    timing = can.BitTiming(8_000_000, brp=1, tseg1=11, tseg2=4, sjw=1)
    assert opened(timing=timing, speed="max").bitrate == 500_000
    fd = can.BitTimingFd(80_000_000, 1, 119, 40, 40, 1, 29, 10, 10)
    with pytest.raises(can.CanInitializationError, match="open as classic CAN, not as CAN FD"):
        opened(timing=fd)


def test_channels_of_all_that_runs_are_found_but_for_those_that_do_not_answer(monkeypatch):
    def channels(name, patience_s):
        assert patience_s == 1.0
        if name == "broken":
            raise UserError("no")
        return ["can1", "can2"]

    monkeypatch.setattr(python_can, "names_running", lambda: ["broken", "a"])
    monkeypatch.setattr(python_can, "channels_of", channels)
    assert python_can.RangerSimBus._detect_available_configs() == [
        {"interface": "ranger_sim", "channel": f"a/{channel}"} for channel in ("can1", "can2")
    ]


def attached_bus(monkeypatch, rate=500_000, missing=False, running=(), **options):
    """RangerSimBus with an attached link that is a stand-in, which keeps what it was made of."""

    class Stand(AttachedLink):
        def __init__(self, *what):
            if missing:
                raise missing
            self.what, self.bitrate, self.label, self.ended = what, rate, f"{what[0]}/{what[1]}", False
            made.append(self)

        def close(self):
            self.ended = True

    made = []
    monkeypatch.setattr(python_can, "AttachedLink", Stand)
    monkeypatch.setattr(python_can, "names_running", lambda: list(running))
    try:
        bus = python_can.RangerSimBus(**options)
        bus._is_shutdown = True
        return bus, made[0].what if made else None
    finally:
        assert not made or made[0].ended or "bus" in locals()


def test_a_robot_is_attached_to_by_the_name_in_front_of_the_channel(monkeypatch):
    for options, what in (
        ({"channel": "can2"}, ("ranger", "can2", False, False, 100_000, False)),
        ({"channel": "r/can2"}, ("r", "can2", False, False, 100_000, False)),
        ({"channel": "can2", "robot": "s", "listen_only": "1"}, ("s", "can2", True, False, 100_000, False)),
        ({"channel": "r/can2", "robot": "s", "receive_own_messages": True}, ("r", "can2", False, True, 100_000, False)),
        ({"channel": "can1", "rx_queue_size": "7", "bitrate": 500_000}, ("ranger", "can1", False, False, 7, False)),
    ):
        bus, made = attached_bus(monkeypatch, **options)
        assert made == what and bus.channel_info == f"ranger_sim {what[0]}/{what[1]}, 500000 bit/s"
        with pytest.raises(can.CanOperationError, match="on a private bus only"):
            bus.inject_errors(1)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"bitrate": 250_000}, "runs at 500000 bit/s, not at 250000"),
        ({"speed": 1.0}, "is a bus of another process: speed can only be set where that is started"),
        ({"seed": 1, "bit_error_rate": 0.0}, "bit_error_rate, seed can only be set"),
    ],
)
def test_what_only_a_private_bus_has_is_refused_on_an_attached_one(monkeypatch, options, words):
    with pytest.raises(can.CanInitializationError, match=words):
        attached_bus(monkeypatch, channel="r/can1", **options)


def test_a_robot_given_by_name_must_run_and_a_default_one_need_not(monkeypatch):
    with pytest.raises(
        can.CanInitializationError, match=r"no robot or bus host named 'r' is running \(running: none\)"
    ):
        attached_bus(monkeypatch, missing=FileNotFoundError("r"), channel="r/can1")
    with pytest.raises(can.CanInitializationError, match=r"'r' is running \(running: a, b\)"):
        attached_bus(monkeypatch, missing=FileNotFoundError("r"), running=("a", "b"), channel="can1", robot="r")
    name = fresh_name()
    for fault in (FileNotFoundError("x"), UserError("no abstract sockets")):
        bus, made = attached_bus(monkeypatch, missing=fault, channel=name, speed="max")
        assert made is None and "private bus" in bus.channel_info
        bus._link.close()
    for options in ({"channel": "r/can1"}, {"channel": name, "running": ("a",)}):
        with pytest.raises(can.CanInitializationError, match="no place"):
            attached_bus(monkeypatch, missing=UserError("no place"), **options)


def test_filters_of_python_can_are_asked_before_anything_is_returned(opened):
    one, two = opened(speed="max"), opened()
    two.set_filters([{"can_id": 5, "can_mask": 0x7FF, "extended": False}])
    for number in (1, 5, 2, 5, 3):
        one.send(can.Message(arbitration_id=number, is_extended_id=False))
    assert [two.recv(0).arbitration_id for _ in range(2)] == [5, 5] and two.recv(0) is None
    two.set_filters(None)
    one.send(can.Message(arbitration_id=9, is_extended_id=False))
    assert two.recv(None).arbitration_id == 9


# ---- the benchmark


def test_interfaces_are_opened_as_the_table_says(monkeypatch):
    calls = []
    monkeypatch.setattr(benchmark.can, "Bus", lambda **options: calls.append(options))
    for interface in ("ranger_sim", "virtual", "udp_multicast"):
        benchmark.opened(interface, "here")
    ours, virtual, multicast = calls
    assert (ours["channel"], ours["speed"], ours["private"], ours["interface"]) == ("here", "max", True, "ranger_sim")
    assert virtual == {"ignore_config": True, "interface": "virtual", "channel": "here"}
    assert multicast["channel"].startswith("239.") and multicast["fd"] is False
    assert "fd" not in ours and all(each["ignore_config"] is True for each in calls)


class Air:
    """An interface of the test: every other bus receives each message but each `lose`-th, and every `swap`-th late."""

    def __init__(self, lose=0):
        self.buses, self.lose, self.count, self.sent = [], lose, 0, []

    def opened(self, _interface, _channel):
        self.buses.append(_OnAir(self))
        return self.buses[-1]


class _OnAir:
    def __init__(self, air):
        self.air, self.queue = air, []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.queue = None

    def send(self, message):
        running = int.from_bytes(message.data, "little")
        self.air.sent.append((self.air.buses.index(self), message.arbitration_id, running))
        for other in self.air.buses:
            if other is not self:
                self.air.count += 1
                if not (self.air.lose and self.air.count % self.air.lose == 0):
                    other.queue.append(message)

    def recv(self, _timeout):
        return self.queue.pop(0) if self.queue else None


@pytest.mark.parametrize(
    ("frames", "nodes", "lose", "lost"), [(12, 3, 0, 0), (10, 3, 0, 0), (20, 2, 7, 2), (1, 4, 0, 0)]
)
def test_what_is_sent_through_an_interface_is_counted_at_every_other_node(monkeypatch, frames, nodes, lose, lost):
    cpu, wall = iter((1.0, 3.0)), iter((10.0, 15.0))
    air = Air(lose)
    monkeypatch.setattr(benchmark, "opened", air.opened)
    monkeypatch.setattr(benchmark.wallclock, "process_cpu_s", lambda: next(cpu))
    monkeypatch.setattr(benchmark.wallclock, "monotonic_s", lambda: next(wall))
    assert benchmark.interface_frames("any", frames, nodes) == {
        "frames": frames,
        "delivered": frames * (nodes - 1) - lost,
        "lost": lost,
        "reordered": 0,
        "cpu_s": 2.0,
        "wall_s": 5.0,
        "frames_per_s": frames / 2.0,
    }
    # in turn, each with a running number of its own: 16 identifiers of each node, 64 between two nodes' first ones
    assert air.sent == [(n % nodes, n % nodes * 64 + n // nodes % 16, n // nodes // 16) for n in range(frames)]


def test_frames_of_a_sender_take_its_sixteen_identifiers_in_turn():
    for sender, number, identifier, running in ((0, 0, 0, 0), (0, 15, 15, 0), (2, 16, 128, 1), (3, 35, 195, 2)):
        message = benchmark.numbered(sender, number)
        assert (message.arbitration_id, bytes(message.data)) == (identifier, struct.pack("<Q", running))
        assert not message.is_extended_id


def test_a_reader_counts_frames_of_others_and_those_out_of_order():
    tally = benchmark.Tally(own=1)
    assert (tally.own, tally.received, tally.reordered, tally.expected) == (1, 0, 0, {})
    for sender, number in ((0, 0), (0, 16), (1, 0), (0, 0), (0, 32), (2, 0), (0, 48), (0, 1), (0, 32)):
        tally.take(benchmark.numbered(sender, number))
    # of identifier 0: 0, 1, then 0 again (late), 2, 3, and 2 again (late)
    assert (tally.received, tally.reordered) == (8, 2)
    everybody = benchmark.Tally()
    everybody.take(benchmark.numbered(0, 0))
    assert everybody.own == -1 and everybody.received == 1


class Helper:
    """In place of a process of the measurement."""

    made: list = []

    def __init__(self, *arguments):
        self.arguments, self.waited, self.ended = arguments, [], False
        self.process = SimpleNamespace(poll=lambda: None if self.patience() else 0)
        Helper.made.append(self)

    left = 2

    def patience(self):
        Helper.left -= 1
        return Helper.left >= 0

    def __enter__(self):
        return self

    def wait_for(self, word):
        self.waited.append(word)

    def __exit__(self, *_):
        self.ended = True


@pytest.mark.parametrize("interface", ["ranger_sim", "virtual"])
@pytest.mark.parametrize(("sent", "lost"), [(4, 0), (3, 1)])
def test_a_burst_between_processes_is_counted_until_it_is_whole_or_nothing_comes(monkeypatch, interface, sent, lost):
    Helper.made, Helper.left = [], 2
    times = iter(range(100, 200))
    opened_with = []

    class Burst:
        queue = [None, *(benchmark.numbered(0, n) for n in range(sent))]

        def __init__(self):
            self.queue = list(self.queue)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def recv(self, timeout):
            assert timeout == 2.0
            return self.queue.pop(0) if self.queue else None

    monkeypatch.setattr(benchmark, "_helper", Helper)
    monkeypatch.setattr(benchmark, "opened", lambda *what: opened_with.append(what) or Burst())
    monkeypatch.setattr(benchmark.can, "Bus", lambda **what: opened_with.append(what) or Burst())
    monkeypatch.setattr(benchmark.wallclock, "monotonic_s", lambda: float(next(times)))
    found = benchmark.two_processes(interface, 4)
    assert found == {
        "frames": 4, "delivered": sent, "lost": lost, "reordered": 0, "wall_s": sent - 1.0,
        "frames_per_s": sent / (sent - 1.0),
    }  # fmt: skip
    name = f"benchmark-{os.getpid()}"
    if interface == "ranger_sim":
        host, sender = Helper.made
        assert host.arguments == ("host", name) and host.waited == ["hosting"]
        [options] = opened_with
        assert (options["interface"], options["channel"], options["ignore_config"]) == (
            "ranger_sim",
            f"{name}/can1",
            True,
        )
    else:
        [sender] = Helper.made
        assert opened_with == [("virtual", name)]
    assert sender.arguments == ("send", interface, name, "4") and all(each.ended for each in Helper.made)


def test_a_process_of_the_measurement_is_waited_for_and_ended(monkeypatch):
    script = "import sys; print('starting'); print('hosting now', flush=True); sys.stdin.read()"
    real = benchmark.subprocess.Popen
    asked = []

    def popen(arguments, **options):
        asked.append(arguments)
        return real([sys.executable, "-c", script], stdin=benchmark.subprocess.PIPE, **options)

    monkeypatch.setattr(benchmark.subprocess, "Popen", popen)
    with benchmark._helper("host", "x") as helper:
        helper.wait_for("hosting")
        assert helper.process.poll() is None
    assert asked == [[sys.executable, "-m", "ranger_sim.can_bus.edge.benchmark", "host", "x"]]
    assert helper.process.poll() is not None and helper.process.stdout.closed
    helper.process.stdin.close()
    script = "print('nothing')"
    with benchmark._helper("host", "x") as helper, pytest.raises(RuntimeError, match="has ended at once"):
        helper.wait_for("hosting")
    helper.process.stdin.close()


def test_the_sender_of_the_measurement_sends_the_number_requested(monkeypatch):
    sent, opened_with = [], []

    class Sender:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            sent.append("shut")

        def send(self, message):
            sent.append((message.arbitration_id, bytes(message.data)[0]))

    monkeypatch.setattr(benchmark, "opened", lambda *what: opened_with.append(what) or Sender())
    monkeypatch.setattr(benchmark.can, "Bus", lambda **what: opened_with.append(what) or Sender())
    for interface in ("virtual", "ranger_sim"):
        benchmark._main(["send", interface, "name", "17"])
    assert sent == ([(n, 0) for n in range(16)] + [(0, 1), "shut"]) * 2
    assert opened_with == [
        ("virtual", "name"), {"interface": "ranger_sim", "channel": "name/can1", "ignore_config": True},
    ]  # fmt: skip


def test_the_host_of_the_measurement_serves_one_bus_at_full_speed(monkeypatch, capsys):
    seen = []

    class Host:
        def __init__(self, buses):
            self.buses = buses
            seen.append(self)

        def serve(self, server):
            self.server = server

        def turn(self):
            self.turns = getattr(self, "turns", 0) + 1
            if self.turns == 3:
                raise KeyboardInterrupt

    monkeypatch.setattr(benchmark, "BusHost", Host)
    name = fresh_name()
    with pytest.raises(KeyboardInterrupt):
        benchmark._main(["host", name])
    [host] = seen
    [bus] = host.buses
    assert (bus.speed, bus.channel, host.turns, host.server.name) == (0.0, "can1", 3, name)
    assert host.server.channels == {"can1": bus.taps} and host.server.epoch_ns == bus.epoch_ns
    assert capsys.readouterr().out == "hosting\n"
    host.server.close()
