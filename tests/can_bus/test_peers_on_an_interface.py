"""An external bus in figures: every frame in and out, and every count, compared with its bits and its limits."""

import errno
import os
import socket
import struct
from types import SimpleNamespace

import can
import pytest

from ranger_sim.can_bus.edge import external_bus
from ranger_sim.can_bus.edge.external_bus import (
    ExternalBus,
    dropped_by_kernel,
    hint_for,
    opener,
    place_of,
    widen,
)
from ranger_sim.foundation.events import (
    CAN_ABORT,
    CAN_MODE,
    CAN_REQUEST,
    CAN_RX,
    CAN_TX_DONE,
    FLAG_EXTENDED,
    FLAG_REMOTE,
    FLAG_SINGLE_SHOT,
    TX_ABORTED,
    TX_LOST,
    TX_SENT,
    EventQueue,
)
from ranger_sim.foundation.user_error import UserError
from tests.can_bus import bit_oracle as oracle

OPERATING, RESET = 0, 1
SECOND = 1_000_000_000
AHEAD = 20_000_000  # frames from outside are handed on so far ahead at most


def length_ns(identifier, data, rate, extended=False, remote=False, length=None):
    """How long a frame and its intermission hold a bus, by the oracle's bits: ten of the tail, three between frames."""
    frame = oracle.Frame(identifier, data, extended=extended, remote=remote, length=length)
    return (len(oracle.stuffed(frame)[0]) + 10 + 3) * SECOND // rate


PLAIN = length_ns(0x155, b"\xaa" * 8, 1_000_000)


class Wire:
    """A python-can bus of the test."""

    def __init__(self):
        self.sent, self.to_read, self.full, self.closed = [], [], False, 0

    def send(self, message, timeout=None):
        assert timeout == 0
        if self.full:
            raise can.CanOperationError("no room")
        self.sent.append(message)

    def recv(self, timeout):
        assert timeout == 0
        return self.to_read.pop(0) if self.to_read else None

    def fileno(self):
        raise NotImplementedError

    def shutdown(self):
        self.closed += 1


class Outside:
    """An external bus with two peers, `wires` and `inboxes` by peer, and the frames that its sink has received."""

    def __init__(self, rate=1_000_000, peers=2):
        self.wires, self.heard = [], []
        self.bus = ExternalBus("can1", rate, self.open)
        self.inboxes = [EventQueue() for _ in range(peers)]
        for number, inbox in enumerate(self.inboxes):
            self.bus.add_peer(f"peer {number}", inbox, 1 + number, 600 + number)
        self.peers = self.bus.peers
        self.bus.sinks.append(lambda *frame: self.heard.append(frame))

    def open(self):
        self.wires.append(Wire())
        return self.wires[-1]

    def ask(self, peer, time, buffer, identifier=0x155, flags=8, lo=0xAAAAAAAA, hi=0xAAAAAAAA):
        self.peers[peer].from_board(CAN_REQUEST, time, buffer, identifier, flags, lo, hi)

    def reported(self, peer):
        inbox, found = self.inboxes[peer], []
        while inbox.take():
            assert inbox.order == 600 + peer
            found.append((inbox.time, inbox.kind, inbox.a, inbox.b, inbox.c, inbox.d, inbox.e))
        return found

    def counts(self, **others):
        """All of `counters` are 0 but for these."""
        names = ("frames_in", "frames_out", "not_taken", "overflow", "refused", "error_frames", "single_shot_skipped")
        assert self.bus.counters() == {**dict.fromkeys(names, 0), **others}


def message(identifier=0x155, data=b"\xaa" * 8, **options):
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=options.pop("extended", False), **options)


# ---- out


@pytest.mark.parametrize("rate", [125_000, 1_000_000, 3_000_000])
@pytest.mark.parametrize(
    ("identifier", "flags", "lo", "hi", "frame"),
    [
        (0x7FF, 0, 0, 0, {"data": b""}),
        (0x000, 3, 0xFF030201, 0, {"data": b"\1\2\3"}),
        (0x123, 5, 0x04030201, 0x05, {"data": b"\1\2\3\4\5"}),
        (0x1ABCDEF0, 8 | FLAG_EXTENDED, 0, 0xFF000000, {"data": bytes(7) + b"\xff", "extended": True}),
        (0x321, 4 | FLAG_REMOTE, 0, 0, {"data": b"", "remote": True, "length": 4}),
        (0x321, 2 | FLAG_SINGLE_SHOT, 0x0201, 0, {"data": b"\1\2"}),
    ],
)
def test_what_goes_out_holds_the_wire_for_its_bits_and_is_recorded_then(rate, identifier, flags, lo, hi, frame):
    outside = Outside(rate)
    outside.ask(0, 7_000, 2, identifier, flags, lo, hi)
    [sent] = outside.wires[0].sent
    assert (sent.arbitration_id, sent.is_extended_id) == (identifier, bool(flags & FLAG_EXTENDED))
    assert (sent.is_remote_frame, sent.is_error_frame, sent.is_fd, sent.is_rx) == (
        bool(flags & FLAG_REMOTE),
        False,
        False,
        False,
    )
    assert (sent.dlc, bytes(sent.data)) == (flags & 15, frame["data"])
    end = 7_000 + length_ns(identifier, rate=rate, **frame)
    assert outside.reported(0) == [(end, CAN_TX_DONE, 1, 2, TX_SENT, 0, 0)]
    assert outside.heard == [(end, identifier, flags & ~FLAG_SINGLE_SHOT, lo, hi)]
    assert outside.bus.busy_ns == outside.bus.window_busy_ns == end - 7_000
    outside.counts(frames_out=1)
    assert outside.reported(1) == [] and outside.wires[1].sent == []


def test_a_controller_sends_one_frame_after_the_other_and_rests_in_between():
    outside = Outside()
    outside.ask(0, 1_000, 1)
    outside.ask(0, 2_000, 2)  # while the first is on the wire
    outside.ask(0, 1_000 + 2 * PLAIN + 5, 3)  # 5 ns after both
    outside.ask(1, 2_000, 1)  # another controller's wire is its own
    ends = [1_000 + PLAIN, 1_000 + 2 * PLAIN, 1_000 + 3 * PLAIN + 5]
    assert outside.reported(0) == [(end, CAN_TX_DONE, 1, n + 1, TX_SENT, 0, 0) for n, end in enumerate(ends)]
    assert outside.reported(1) == [(2_000 + PLAIN, CAN_TX_DONE, 2, 1, TX_SENT, 0, 0)]
    assert outside.peers[0].free_ns == ends[-1]
    outside.counts(frames_out=4)
    assert [frame[0] for frame in outside.heard] == ends


def test_frames_for_a_full_interface_are_tried_at_each_poll_in_order_and_single_shots_once():
    outside = Outside()
    outside.wires[0].full = True
    outside.ask(0, 10, 1, flags=8 | FLAG_SINGLE_SHOT)
    outside.counts(not_taken=1, single_shot_skipped=1)
    outside.ask(0, 20, 2, identifier=2)
    outside.ask(0, 30, 3, identifier=3, flags=8 | FLAG_SINGLE_SHOT)  # behind one that waits: tries that one
    assert outside.reported(0) == [(10, CAN_TX_DONE, 1, 1, TX_LOST, 0, 0)]
    outside.counts(not_taken=3, single_shot_skipped=1)
    assert outside.bus.last_error == "peer 0: no room"
    assert outside.bus.poll(1_000) == 126_000
    outside.counts(not_taken=4, single_shot_skipped=1)
    assert outside.heard == [] and outside.wires[0].sent == []
    outside.peers[0].from_board(CAN_ABORT, 2_000, 2, 0, 0, 0, 0)
    outside.bus.poll(3_000)  # now the single shot is the first
    assert outside.reported(0) == [
        (2_000, CAN_TX_DONE, 1, 2, TX_ABORTED, 0, 0),
        (3_000, CAN_TX_DONE, 1, 3, TX_LOST, 0, 0),
    ]
    outside.counts(not_taken=5, single_shot_skipped=2)
    assert not outside.peers[0].waiting


def test_behind_a_lost_single_shot_the_next_frame_is_tried_at_once():
    outside = Outside()
    outside.wires[0].full = True
    outside.ask(0, 0, 1, identifier=1)
    outside.ask(0, 0, 2, identifier=2, flags=8 | FLAG_SINGLE_SHOT)
    outside.ask(0, 0, 3, identifier=3)
    outside.peers[0].from_board(CAN_ABORT, 0, 1, 0, 0, 0, 0)
    outside.reported(0)
    before = outside.bus.not_taken
    outside.bus.poll(50)
    assert outside.bus.not_taken == before + 2
    outside.wires[0].full = False
    outside.bus.poll(100)
    assert [sent.arbitration_id for sent in outside.wires[0].sent] == [3]


def test_a_controller_in_reset_drops_all_and_takes_nothing_until_it_operates_again():
    outside = Outside()
    outside.wires[0].full = True
    for buffer in (1, 2, 3):
        outside.ask(0, 5, buffer, identifier=buffer)
    outside.peers[0].from_board(CAN_ABORT, 6, 3, 0, 0, 0, 0)
    outside.peers[0].from_board(CAN_ABORT, 6, 3, 0, 0, 0, 0)  # waits no more
    outside.peers[0].from_board(CAN_MODE, 7, RESET, 0, 0, 0, 0)
    outside.wires[0].full = False
    outside.ask(0, 8, 1)
    outside.wires[0].to_read = [message()]
    outside.bus.poll(SECOND)  # it hears nothing, but the frame was on the bus
    assert [frame[1] for frame in outside.heard] == [0x155]
    outside.peers[0].from_board(CAN_MODE, 9, OPERATING, 0, 0, 0, 0)
    outside.ask(0, 10, 1)
    assert outside.reported(0) == [
        (6, CAN_TX_DONE, 1, 3, TX_ABORTED, 0, 0),
        (7, CAN_TX_DONE, 1, 1, TX_ABORTED, 0, 0),
        (7, CAN_TX_DONE, 1, 2, TX_ABORTED, 0, 0),
        (8, CAN_TX_DONE, 1, 1, TX_ABORTED, 0, 0),
        (10 + PLAIN, CAN_TX_DONE, 1, 1, TX_SENT, 0, 0),
    ]
    outside.counts(frames_in=1, frames_out=1, not_taken=3)


# ---- in


def test_a_received_frame_has_its_flags_its_words_and_its_own_time():
    outside = Outside()
    frames = [
        (message(0x1F, b"\1\2\3"), (0x1F, 3, 0x030201, 0), {}),
        (
            message(0x1ABCDEF0, bytes(range(8)), extended=True),
            (0x1ABCDEF0, 8 | FLAG_EXTENDED, 0x03020100, 0x07060504),
            {"extended": True},
        ),
        (
            message(0x7, b"", is_remote_frame=True, dlc=6),
            (0x7, 6 | FLAG_REMOTE, 0, 0),
            {"remote": True, "length": 6},
        ),
        # drivers give a length code as it comes: those above eight mean eight
        (message(0x8, b"\xaa" * 8, dlc=8), (0x8, 8, 0xAAAAAAAA, 0xAAAAAAAA), {}),
    ]
    frames[3][0].dlc = 13
    outside.wires[1].to_read = [each for each, _, _ in frames]
    now = 5 * SECOND
    assert outside.bus.poll(now) == now + 125_000
    expected = []
    for number, (each, frame, options) in enumerate(frames):
        if number:
            now += length_ns(frame[0], bytes(each.data), 1_000_000, **options)
        expected.append((now, CAN_RX, 2, *frame))
    assert outside.reported(1) == expected
    assert outside.peers[1].read_ns == now
    outside.counts()  # only what the first peer hears is a frame of this bus
    assert outside.heard == []


def test_a_poll_reads_two_hundred_frames_of_each_peer():
    outside = Outside()
    for wire in outside.wires:
        wire.to_read = [message(n, b"") for n in range(250)]
    outside.bus.poll(SECOND)
    assert [len(wire.to_read) for wire in outside.wires] == [50, 50]
    outside.counts(frames_in=200, overflow=0)
    outside.bus.poll(2 * SECOND)
    outside.counts(frames_in=250)
    assert len(outside.reported(0)) == len(outside.reported(1)) == 250


def test_frames_are_handed_on_20_ms_ahead_and_no_further():
    outside = Outside()
    outside.wires[0].to_read = [message() for _ in range(199)]
    now = 3 * SECOND
    outside.bus.poll(now)
    fits = AHEAD // PLAIN + 1  # the first one comes at once
    assert [each[0] for each in outside.reported(0)] == [now + n * PLAIN for n in range(fits)]
    outside.counts(frames_in=199, overflow=199 - fits)
    assert [frame[0] for frame in outside.heard] == [now + min(n * PLAIN, AHEAD) for n in range(fits)] + [
        now + AHEAD
    ] * (199 - fits)
    # what came later than that is no more ahead of a later look
    outside.wires[0].to_read = [message()]
    outside.bus.poll(now + 1_000_000)
    assert [each[0] for each in outside.reported(0)] == [now + fits * PLAIN]


def test_a_frame_exactly_20_ms_ahead_is_handed_on():
    outside = Outside()
    outside.wires[0].to_read = [message(), message()]
    outside.peers[0].read_ns = SECOND + AHEAD - PLAIN
    outside.bus.poll(SECOND)
    assert [each[0] for each in outside.reported(0)] == [SECOND + AHEAD]
    outside.counts(frames_in=2, overflow=1)


def test_a_frame_that_is_not_classic_is_counted_and_the_next_one_is_read():
    outside = Outside()
    outside.wires[0].to_read = [
        can.Message(is_error_frame=True),
        message(1, bytes(12), is_fd=True),
        message(2, b""),
    ]
    outside.wires[1].to_read = [can.Message(is_error_frame=True), message(1, bytes(12), is_fd=True)]
    outside.bus.poll(SECOND)
    outside.counts(frames_in=1, refused=2, error_frames=1)
    assert [each[3] for each in outside.reported(0)] == [2] and outside.reported(1) == []


def test_an_interface_that_breaks_is_left_out_until_it_gives_again():
    outside = Outside()
    reading, writing = os.pipe()

    class Filed(Wire):
        def fileno(self):
            return reading

        def recv(self, timeout):
            if self.full:
                raise OSError("gone")
            return super().recv(timeout)

    wire = Filed()
    peer = outside.bus.add_peer("third", EventQueue(), 1, 700, lambda: wire)
    os.write(writing, b"x")
    assert outside.bus.filenos() == [reading] and peer.unreadable == ""
    wire.full = True
    outside.bus.poll(0)
    assert outside.bus.filenos() == [] and peer.unreadable == "gone"
    assert outside.bus.last_error == "third: gone"
    wire.full = False
    outside.bus.poll(0)
    assert outside.bus.filenos() == [reading] and peer.unreadable == ""
    outside.bus.remove_peer(peer)
    assert wire.closed == 1 and outside.bus.filenos() == [] and len(outside.peers) == 2
    os.close(reading)
    os.close(writing)


def test_a_bus_with_more_frames_than_fit_is_full_and_not_fuller():
    """199 frames of zeros take more than 24 ms and are recorded within 20; the second window has the rest."""
    outside = Outside()
    zeros = message(0, bytes(8))
    outside.wires[0].to_read = [zeros for _ in range(199)]
    outside.bus.poll(SECOND)
    assert 199 * length_ns(0, bytes(8), 1_000_000) > 24_000_000
    assert 0.9 < outside.bus.window_load <= 1.0
    outside.ask(0, SECOND + AHEAD + 1_000_000, 1)
    assert outside.bus.window_load == 1.0


def test_leaving_closes_all_peers_even_if_one_raises():
    outside = Outside(peers=3)

    def stubborn():
        raise OSError("busy")

    def odd():
        raise can.CanOperationError("odd")

    outside.wires[0].shutdown, outside.wires[1].shutdown = stubborn, odd
    outside.bus.close()
    assert outside.wires[2].closed == 1


def test_draining_ends_when_nothing_comes_any_more():
    outside = Outside()
    outside.wires[0].to_read = [message(n, b"") for n in range(450)]
    outside.bus.drain(SECOND)
    outside.counts(frames_in=450, overflow=450 - len(outside.reported(0)))
    assert outside.wires[0].to_read == []


# ---- sockets


class Recorded(socket.socket):
    """A socket that keeps what is set, and refuses it when `broken`."""

    broken = False

    def setsockopt(self, *what):
        self.calls = [*getattr(self, "calls", []), what]
        if self.broken:
            raise OSError("not permitted")

    def getsockopt(self, *what):
        raise OSError("not known")


@pytest.mark.parametrize("broken", [False, True])
def test_a_socket_is_asked_for_8_mb_in_both_ways(broken):
    """socket(7): SO_RCVBUF is bounded by the system, SO_RCVBUFFORCE (33) for who may, by nothing."""
    with Recorded(socket.AF_INET, socket.SOCK_DGRAM) as end:
        end.broken = broken
        widen(SimpleNamespace(socket=end))
        assert end.calls == [(socket.SOL_SOCKET, option, 8 * 1024 * 1024) for option in (socket.SO_RCVBUF, 33)]
    widen(SimpleNamespace(socket="no socket"))
    widen(SimpleNamespace())


def test_what_the_kernel_has_dropped_is_what_was_sent_and_not_read():
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far,
    ):
        end.bind(("127.0.0.1", 0))
        end.setblocking(False)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)  # the least that there is
        connection = SimpleNamespace(socket=end)
        assert dropped_by_kernel(connection) == 0
        for _ in range(64):
            far.sendto(bytes(1000), end.getsockname())
        dropped = dropped_by_kernel(connection)
        read = 0
        try:
            while end.recv(2000):
                read += 1
        except BlockingIOError:
            pass
        assert read > 0 and dropped == 64 - read > 0


def test_an_interface_that_is_not_a_socket_or_has_no_counter_has_dropped_nothing():
    assert dropped_by_kernel(SimpleNamespace()) == dropped_by_kernel(SimpleNamespace(socket=7)) == 0
    with Recorded(socket.AF_INET, socket.SOCK_DGRAM) as end:
        assert dropped_by_kernel(SimpleNamespace(socket=end)) == 0


def test_drops_of_all_peers_are_overflow():
    outside = Outside(peers=3)

    class Dropping(socket.socket):
        def getsockopt(self, level, option, size):
            assert (level, option) == (socket.SOL_SOCKET, 55)  # SO_MEMINFO
            return struct.pack("=9I", 0, 1, 2, 3, 4, 5, 6, 7, self.drops)[:size]

    ends = [Dropping(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
    for end, wire, drops in zip(ends, outside.wires, (5, 11), strict=False):
        end.drops, wire.socket = drops, end
    outside.bus.overflow = 100
    outside.counts(overflow=116)
    for end in ends:
        end.close()


# ---- places


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("can1=vcan0 --bitrate 500000", {"channel": "vcan0", "bitrate": 500_000}),
        ("can1=--bitrate 250000", {"bitrate": 250_000}),
        ("can1='a b'", {"channel": "a b"}),
        ("can1=virtual:a:b=c", {"interface": "virtual", "channel": "a:b=c"}),
    ],
)
def test_a_place_is_an_interface_a_channel_and_options_as_far_as_given(text, found):
    assert place_of(text) == ("can1", found)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("can1", "BUS=INTERFACE:CHANNEL is expected"),
        ("=virtual:a", "BUS=INTERFACE:CHANNEL is expected"),
        ("can1=virtual:", "no channel after virtual:"),
        ("can1=nothing:a", "knows no interface nothing; it knows .*, virtual"),
        ("can1=virtual:a b", "unrecognized arguments: b"),
    ],
)
def test_a_fault_in_a_place_is_reported(text, words):
    with pytest.raises(UserError, match=f"^--bus {text}: .*{words}"):
        place_of(text)


def test_without_any_interface_the_ways_to_name_one_are_listed(monkeypatch):
    monkeypatch.setattr(can.util, "CONFIG_FILES", [])
    monkeypatch.delenv("CAN_INTERFACE", raising=False)
    with pytest.raises(UserError, match=r"bus can9: .* as in can9=socketcan:vcan0, .* section \[can9\]"):
        opener("can9", {"channel": "x"})


@pytest.mark.parametrize(
    ("error", "keywords", "where", "words"),
    [
        (OSError(errno.ENODEV, "No such device"), {"channel": "vcan7"}, "virtual:vcan7", "dev vcan7|add vcan7"),
        (OSError(errno.ENODEV, "No such device"), {}, "virtual:(by configuration)", "add vcan0 type vcan"),
        (OSError(errno.EAFNOSUPPORT, "no family"), {"channel": "vcan7"}, "virtual:vcan7", "python -m dev.vm"),
        (ValueError(), {"channel": "c"}, "virtual:c", "ValueError$"),
        (RuntimeError("two\n  lines"), {"channel": "c"}, "virtual:c", "two lines$"),
    ],
)
def test_why_an_interface_does_not_open_is_one_line_with_what_helps(monkeypatch, error, keywords, where, words):
    def broken(**_):
        raise error

    keywords = {"interface": "virtual", **keywords}
    opened = opener("can1", keywords)
    monkeypatch.setattr(external_bus.can, "Bus", broken)
    with pytest.raises(UserError, match=words) as caught:
        opened()
    assert str(caught.value).startswith(f"bus can1 on {where}: ") and "\n" not in str(caught.value)


def test_only_a_missing_device_and_a_missing_family_have_a_hint():
    assert hint_for(OSError(errno.EPERM, "not permitted"), {}) == ""
    odd = ValueError("has the number but is no error of the system")
    odd.errno = errno.ENODEV
    assert hint_for(odd, {}) == ""
    odd.errno = errno.EAFNOSUPPORT
    assert hint_for(odd, {}) == ""
