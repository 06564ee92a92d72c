"""Controllers as peers on python-can interfaces: what goes out, what comes in, what is counted when it does not fit."""

import os

import can
import pytest

from ranger_sim.can_bus.edge.external_bus import AHEAD_NS, ExternalBus, opener, place_of
from ranger_sim.can_bus.frame import frame_bits
from ranger_sim.foundation.events import (
    CAN_ABORT,
    CAN_MODE,
    CAN_REQUEST,
    CAN_RX,
    CAN_TX_DONE,
    FLAG_SINGLE_SHOT,
    TX_ABORTED,
    TX_LOST,
    TX_SENT,
    EventQueue,
)
from ranger_sim.foundation.user_error import UserError

FRAME_NS = (frame_bits(0x123, 8, 1, 2) + 3) * 1000  # at 1 Mbit/s


class Wire:
    """A python-can bus of the test: keeps what is sent, gives what is put in, and can be full."""

    def __init__(self):
        self.sent, self.to_read, self.full = [], [], False

    def send(self, message, timeout=None):
        if self.full:
            raise can.CanOperationError("Transmit buffer full")
        self.sent.append(message)

    def recv(self, timeout):
        assert timeout == 0
        return self.to_read.pop(0) if self.to_read else None

    def fileno(self):
        raise NotImplementedError

    def shutdown(self):
        self.sent = None


@pytest.fixture
def bus():
    wires = []

    def open_peer():
        wires.append(Wire())
        return wires[-1]

    external = ExternalBus("can1", 1_000_000, open_peer)
    external.wires = wires
    external.inboxes = [EventQueue(), EventQueue()]
    external.add_peer("can1, CSR", external.inboxes[0], 1, 600)
    external.add_peer("can1, MCH", external.inboxes[1], 1, 610)
    external.heard = []
    external.sinks.append(lambda *frame: external.heard.append(frame))
    return external


def messages_of(inbox):
    found = []
    while inbox.take():
        found.append((inbox.time, inbox.order, inbox.kind, inbox.a, inbox.b, inbox.c, inbox.d, inbox.e))
    return found


def test_a_request_is_a_frame_outside_and_done_when_its_bits_are_through(bus):
    bus.peers[1].from_board(CAN_REQUEST, 5000, 2, 0x123, 8, 1, 2)
    (message,) = bus.wires[1].sent
    assert (message.arbitration_id, bytes(message.data), message.is_extended_id) == (
        0x123,
        b"\1\0\0\0\2\0\0\0",
        False,
    )
    assert messages_of(bus.inboxes[1]) == [(5000 + FRAME_NS, 610, CAN_TX_DONE, 1, 2, TX_SENT, 0, 0)]
    assert bus.wires[0].sent == [] and bus.frames_out == 1


def test_a_second_request_waits_for_the_bits_of_the_first(bus):
    for buffer in (1, 2):
        bus.peers[0].from_board(CAN_REQUEST, 0, buffer, 0x123, 8, 1, 2)
    assert [each[0] for each in messages_of(bus.inboxes[0])] == [FRAME_NS, 2 * FRAME_NS]


def test_what_the_interface_does_not_take_is_counted_and_tried_again(bus):
    bus.wires[0].full = True
    bus.peers[0].from_board(CAN_REQUEST, 0, 1, 0x123, 8, 1, 2)
    bus.poll(125_000)
    assert bus.not_taken == 2 and messages_of(bus.inboxes[0]) == [] and "Transmit buffer full" in bus.last_error
    bus.wires[0].full = False
    bus.poll(250_000)
    assert len(bus.wires[0].sent) == 1
    assert messages_of(bus.inboxes[0]) == [(250_000 + FRAME_NS, 600, CAN_TX_DONE, 1, 1, TX_SENT, 0, 0)]


def test_a_single_shot_that_is_not_taken_is_lost_at_once(bus):
    bus.wires[0].full = True
    bus.peers[0].from_board(CAN_REQUEST, 70, 3, 0, 8 | FLAG_SINGLE_SHOT, 1, 2)
    assert messages_of(bus.inboxes[0]) == [(70, 600, CAN_TX_DONE, 1, 3, TX_LOST, 0, 0)]
    assert bus.single_shot_skipped == 1


def test_aborting_and_resetting_take_back_what_waits(bus):
    bus.wires[0].full = True
    for buffer in (1, 2, 3):
        bus.peers[0].from_board(CAN_REQUEST, 0, buffer, 0x100 + buffer, 8, 0, 0)
    bus.peers[0].from_board(CAN_ABORT, 10, 2, 0, 0, 0, 0)
    bus.peers[0].from_board(CAN_MODE, 20, 1, 0, 0, 0, 0)
    bus.peers[0].from_board(CAN_REQUEST, 30, 1, 0x123, 8, 0, 0)
    done = [(time, buffer, status) for time, _, _, _, buffer, status, _, _ in messages_of(bus.inboxes[0])]
    assert done == [(10, 2, TX_ABORTED), (20, 1, TX_ABORTED), (20, 3, TX_ABORTED), (30, 1, TX_ABORTED)]


def test_frames_from_outside_reach_the_board_one_after_the_other(bus):
    bus.wires[1].to_read = [can.Message(arbitration_id=0x123, data=b"\1\0\0\0\2\0\0\0", is_extended_id=False)] * 3
    assert bus.poll(1_000_000) > 1_000_000
    assert messages_of(bus.inboxes[1]) == [
        (1_000_000 + place * FRAME_NS, 610, CAN_RX, 1, 0x123, 8, 1, 2) for place in range(3)
    ]


def test_a_flood_is_counted_and_does_not_run_ahead(bus):
    bus.wires[1].to_read = [can.Message(arbitration_id=0x123, data=b"12345678", is_extended_id=False)] * 190
    bus.poll(0)
    arrived = messages_of(bus.inboxes[1])
    assert bus.overflow == 190 - len(arrived) > 0 and arrived[-1][0] <= AHEAD_NS


def test_a_frame_of_the_bus_is_recorded_once(bus):
    """The first peer receives what others send, but not its own frames, so these are recorded as it sends them."""
    bus.peers[0].from_board(CAN_REQUEST, 0, 1, 0x101, 8, 1, 2)
    bus.peers[1].from_board(CAN_REQUEST, 0, 1, 0x102, 8, 3, 4)
    bus.wires[0].to_read = bus.wires[1].sent[:]
    bus.wires[1].to_read = bus.wires[0].sent[:]
    bus.poll(1_000_000)
    assert [frame[1] for frame in bus.heard] == [0x101, 0x102]


def test_error_frames_and_can_fd_are_counted_and_not_delivered(bus):
    bus.wires[0].to_read = [can.Message(is_error_frame=True), can.Message(is_fd=True, data=bytes(12))]
    bus.poll(0)
    assert (bus.errors, bus.refused) == (1, 1) and messages_of(bus.inboxes[0]) == []


def test_an_interface_that_breaks_is_reported_and_does_not_raise(bus):
    def broken(_timeout):
        raise can.CanOperationError("Network is down")

    bus.wires[0].recv = broken
    bus.poll(0)
    assert bus.last_error == "can1, CSR: Network is down"


def test_leaving_shuts_every_peer_down(bus):
    bus.close()
    assert [wire.sent for wire in bus.wires] == [None, None]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("can1=socketcan:vcan0", ("can1", {"interface": "socketcan", "channel": "vcan0"})),
        ("can2=slcan:/dev/ttyACM0@115200", ("can2", {"interface": "slcan", "channel": "/dev/ttyACM0@115200"})),
        ("can3=socketcand:host:29536", ("can3", {"interface": "socketcand", "channel": "host:29536"})),
        ("can1=vcan0", ("can1", {"channel": "vcan0"})),
        ("can1=", ("can1", {})),
    ],
)
def test_where_a_bus_goes(text, found):
    assert place_of(text) == found


@pytest.mark.parametrize("text", ["can1", "=socketcan:vcan0", "can1=socketcan:", "can1=nothing:0"])
def test_a_place_that_means_nothing_is_refused(text):
    with pytest.raises(UserError, match="--bus"):
        place_of(text)


def test_python_cans_configuration_fills_in_what_is_not_given(monkeypatch, tmp_path):
    """Its file, with a section of the bus's name, and its environment variables; what is given comes first."""
    file = tmp_path / "can.conf"
    file.write_text("[default]\ninterface = virtual\n[can1]\nchannel = by-file\n")
    monkeypatch.setattr(can.util, "CONFIG_FILES", [str(file)])
    with opener("can1", {})() as opened:
        assert opened.channel_info == "Virtual bus channel by-file"
    with opener("can1", {"channel": "given"})() as opened:
        assert opened.channel_info == "Virtual bus channel given"
    monkeypatch.setattr(can.util, "CONFIG_FILES", [])
    monkeypatch.setenv("CAN_INTERFACE", "virtual")
    monkeypatch.setenv("CAN_CHANNEL", "by-environment")
    with opener("can1", {})() as opened:
        assert opened.channel_info == "Virtual bus channel by-environment"


def test_an_interface_that_is_not_there_is_one_line():
    with pytest.raises(UserError, match="bus can1 on slcan:/dev/no-such-port: "):
        opener("can1", {"interface": "slcan", "channel": "/dev/no-such-port"})()


def test_python_cans_own_options_follow_the_place():
    text = "can1=slcan:/dev/ttyACM0 --bitrate 1000000 --bus-kwargs app_name=ranger serial=7"
    assert place_of(text) == (
        "can1",
        {
            "interface": "slcan",
            "channel": "/dev/ttyACM0",
            "bitrate": 1_000_000,
            "app_name": "ranger",
            "serial": 7,
        },
    )
    with pytest.raises(UserError, match="--bus can1=slcan:x --bitrate fast: .*invalid int value"):
        place_of("can1=slcan:x --bitrate fast")


def test_a_board_may_have_its_own_place_on_the_bus(bus):
    other = Wire()
    peer = bus.add_peer("can1, UI", EventQueue(), 1, 620, lambda: other)
    peer.from_board(CAN_REQUEST, 0, 1, 0x123, 8, 0, 0)
    assert len(other.sent) == 1 and len(bus.wires) == 2


def test_at_the_end_everything_that_was_sent_is_read(bus):
    bus.wires[0].to_read = [can.Message(arbitration_id=number, is_extended_id=False) for number in range(500)]
    bus.drain(0)
    assert [frame[1] for frame in bus.heard] == list(range(500))


def test_nothing_has_happened_on_a_bus_that_is_new():
    external = ExternalBus("can1", 1_000_000, Wire)
    counts = ("frames_in", "frames_out", "not_taken", "overflow", "refused", "errors", "single_shot_skipped", "busy_ns")
    assert [getattr(external, each) for each in counts] == [0] * len(counts)
    assert (external.window_load, external.last_error) == (0.0, "")
    assert external.add_peer("can1, CSR", EventQueue(), 1, 600).descriptor == -1  # this interface has no file


def test_the_load_is_that_of_the_last_window_of_10_ms_that_is_over(bus):
    """Frames of FRAME_NS each: a window ends with the first frame 10 ms or more after it began."""
    for number in range(3):
        bus.peers[0].from_board(CAN_REQUEST, number * 1_000_000, 1, 0x123, 8, 1, 2)
    assert (bus.busy_ns, bus.window_load) == (3 * FRAME_NS, 0.0)
    last = 10_000_000 - FRAME_NS  # its end is exactly 10 ms after the window's begin
    bus.peers[0].from_board(CAN_REQUEST, last - 1, 1, 0x123, 8, 1, 2)
    assert bus.window_load == 0.0
    bus.peers[0].from_board(CAN_REQUEST, last + FRAME_NS - 1, 1, 0x123, 8, 1, 2)
    end = last + 2 * FRAME_NS - 1
    assert bus.window_load == pytest.approx(4 * FRAME_NS / end, rel=1e-12)
    assert (bus.window_ns, bus.window_busy_ns, bus.busy_ns) == (end, FRAME_NS, 5 * FRAME_NS)
    bus.peers[0].from_board(CAN_REQUEST, end + 10_000_000 - FRAME_NS, 1, 0x123, 8, 1, 2)
    assert bus.window_load == pytest.approx(FRAME_NS / 10_000_000, rel=1e-12)
    assert (bus.window_ns, bus.window_busy_ns) == (end + 10_000_000, FRAME_NS)


def test_only_the_first_peer_counts_for_the_load(bus):
    bus.peers[1].from_board(CAN_REQUEST, 0, 1, 0x123, 8, 1, 2)
    assert (bus.busy_ns, bus.heard) == (0, [])


def test_an_interface_with_a_file_is_read_when_its_file_is_readable(bus):
    """A pipe represents a socket: `recv` is asked only when something lies in it."""
    reading, writing = os.pipe()
    asked = []

    class Filed(Wire):
        def fileno(self):
            return reading

        def recv(self, timeout):
            asked.append(timeout)
            return None

    peer = bus.add_peer("can1, own", EventQueue(), 1, 620, Filed)
    assert peer.descriptor == reading
    bus.poll(0)
    assert asked == []
    os.write(writing, b"x")
    bus.poll(0)
    assert asked == [0]
    bus.remove_peer(peer)
    bus.poll(0)
    assert asked == [0] and peer not in bus.peers
    for end in (reading, writing):
        os.close(end)
