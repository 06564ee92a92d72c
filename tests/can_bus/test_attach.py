"""The attach protocol byte by byte, and what no client may do to the process that owns the buses."""

import pathlib
import socket
import struct
import sys
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge import attach_records as wire
from ranger_sim.can_bus.edge import attached_link
from ranger_sim.can_bus.edge import host as host_module
from ranger_sim.can_bus.edge.attach import AttachServer
from ranger_sim.can_bus.edge.host import BusHost
from ranger_sim.can_bus.edge.paced import PacedBus
from ranger_sim.can_bus.edge.peers import LIMITS
from ranger_sim.can_bus.edge.taps import RECEIVED, TRANSMIT_QUEUE
from ranger_sim.can_bus.node import RESET
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE, FLAG_SINGLE_SHOT, STAGE_BUS, EventQueue
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError

from .hosting import PATIENCE_S, fresh_name, hosted

RATE = 1_000_000
STEP_NS = 31_250


class Owner:
    """What a plant process is to the server: it owns two buses with a board each, and polls."""

    def __init__(self, epoch_ns=0):
        self.name = fresh_name()
        self.buses = {channel: Bus(channel, RATE) for channel in ("can1", "can2")}
        self.inboxes = {channel: EventQueue(64) for channel in self.buses}
        for channel, bus in self.buses.items():
            bus.add_node("board", self.inboxes[channel], 1, STAGE_BUS * 256)
        self.server = AttachServer(self.name, self.buses, epoch_ns)
        self.time = 0
        self.clients = []

    def run(self, steps=1):
        for _ in range(steps):
            self.server.poll(self.time)
            for bus in self.buses.values():
                bus.advance(self.time)
            self.time += STEP_NS

    def connect(self):
        client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        client.connect(wire.SOCKET_PREFIX + self.name)
        client.setblocking(False)
        self.clients.append(client)
        return client

    def attached(self, channel="can1", options=0):
        client = self.connect()
        client.send(hello(channel, options))
        self.run(2)
        ((kind, body),) = said(client)
        assert kind == wire.WELCOME
        return client, body

    def close(self):
        self.server.close()
        for client in self.clients:
            client.close()


@pytest.fixture
def owner():
    each = Owner()
    yield each
    each.close()


def hello(channel, options=0, version=wire.VERSION, magic=wire.MAGIC):
    return wire.record(wire.HELLO, wire.HELLO_BODY.pack(magic, version, options) + channel.encode())


def said(client, data=None):
    """[(type, body)] of what the server has sent by now; the beginning of a record stays in `data`, if given."""
    partly, data = data is not None, bytearray() if data is None else data
    try:
        while more := client.recv(1 << 20):
            data += more
    except (BlockingIOError, ConnectionResetError):
        pass
    found = list(wire.records_of(data))
    assert partly or not data
    return found


def frames_of(records, kind=wire.FRAME):
    return [wire.FRAME_BODY.unpack(body) for each, body in records if each == kind]


# --- known bytes --------------------------------------------------------------------------------------------


def test_records_are_the_bytes_that_the_description_says():
    assert wire.record(wire.CONTROL, b"\x01") == bytes([2, 0, 0, 0, 9, 1])
    assert wire.send_record(0x123, 3, 0x030201, 0) == bytes.fromhex("0f000000 04 23010000 0300 01020300 00000000")
    assert wire.frame_record(wire.FRAME, 5, 1, 0, 0, 0) == bytes.fromhex(
        "17000000 05 0500000000000000 01000000 0000 00000000 00000000"
    )
    assert hello("can1") == bytes.fromhex("0d000000 01 524e4752 0100 0000 63616e31")
    assert wire.address_of("ranger") == "\0ranger-sim/ranger"


def test_the_description_names_every_record():
    page = pathlib.Path(attached_link.__file__).with_name("ATTACH.md").read_text(encoding="utf-8")
    for name in ("HELLO", "WELCOME", "REFUSED", "SEND", "FRAME", "SENT", "DROPPED", "STATE", "CONTROL", "OVERFLOW"):
        assert f"| {getattr(wire, name)} | " in page.replace(f"| {name} |", f"| {name} |") and f"| {name} |" in page
    assert f"version {wire.VERSION}" in page.splitlines()[0]


# --- one client ---------------------------------------------------------------------------------------------


def test_a_welcome_has_window_bit_rate_epoch_and_channels():
    owner = Owner(epoch_ns=77)
    _, body = owner.attached()
    assert wire.WELCOME_BODY.unpack_from(body) == (1, TRANSMIT_QUEUE, RATE, 77)
    assert body[wire.WELCOME_BODY.size :] == b"can1\ncan2"
    owner.close()


def test_a_frame_goes_to_the_boards_and_is_answered_with_its_time(owner):
    client, _ = owner.attached()
    client.send(wire.send_record(0x123, 2, 0xBBAA, 0))
    owner.run(10)
    ((time_ns, identifier, flags, lo, hi),) = frames_of(said(client), wire.SENT)
    assert (identifier, flags, lo, hi) == (0x123, 2, 0xBBAA, 0)
    inbox = owner.inboxes["can1"]
    assert inbox.take() and (inbox.b, inbox.c, inbox.d) == (0x123, 2, 0xBBAA)
    assert time_ns == inbox.time + 1_000_000_000 // RATE  # a sender is done one bit after its receivers


def test_a_client_receives_the_boards_of_its_channel_only(owner):
    one, _ = owner.attached("can1")
    two, _ = owner.attached("can2")
    owner.buses["can1"].request(0, 1, owner.time, 0x55, 8, 1, 2)
    owner.run(10)
    assert [frame[1:] for frame in frames_of(said(one))] == [(0x55, 8, 1, 2)]
    assert said(two) == []


def test_how_often_a_board_tries_is_its_own_business(owner):
    client, _ = owner.attached()
    owner.buses["can1"].request(0, 1, owner.time, 0x55, 8 | FLAG_SINGLE_SHOT, 1, 2)
    owner.run(10)
    assert [frame[1:] for frame in frames_of(said(client))] == [(0x55, 8, 1, 2)]


def test_a_sender_without_acknowledgement_receives_error_frames_until_nothing_changes_any_more(owner):
    client, _ = owner.attached()
    owner.buses["can1"].set_mode(0, RESET, owner.time)
    owner.run(2)
    client.send(wire.send_record(0x55, 0, 0, 0))
    owner.run(1000)
    assert owner.buses["can1"].counters.errors > 100
    errors = frames_of(said(client))
    assert len(errors) == 16 and all(frame[2] & FLAG_ERROR for frame in errors)


def test_a_client_that_only_asks_gets_the_channels_and_is_not_a_node(owner):
    client = owner.connect()
    client.send(hello(""))
    owner.run()
    ((kind, body),) = said(client)
    assert kind == wire.WELCOME and body.endswith(b"can1\ncan2")
    assert owner.server.counters()["clients"] == 0 and len(owner.buses["can1"].nodes) == 1


def test_what_a_client_had_queued_is_sent_after_it_left_and_its_place_is_used_again(owner):
    client, _ = owner.attached()
    client.sendall(b"".join(wire.send_record(number, 0, 0, 0) for number in range(20)))
    client.close()
    owner.run(200)
    received = []
    inbox = owner.inboxes["can1"]
    while inbox.take():
        received.append(inbox.b)
    assert received == list(range(20))
    for _ in range(5):
        again, _ = owner.attached()
        owner.run(5)
        again.close()
        owner.run(5)
    assert len(owner.buses["can1"].nodes) == 2
    assert owner.server.counters()["clients_seen"] == 6


def test_a_board_sends_the_same_frames_at_the_same_times_with_and_without_a_listener():
    logs = []
    for listeners in (0, 2):
        owner = Owner()
        for _ in range(listeners):
            owner.attached()
        other = owner.buses["can1"].add_node("other", EventQueue(64), 1, STAGE_BUS * 256 + 1)
        owner.run(10 - owner.time // STEP_NS)
        for number in range(50):
            owner.buses["can1"].request(number % 2 * other, 1, owner.time, 0x100 + number, 8, number, 0)
            owner.run(5)
        logs.append([frame[:5] for frame in owner.buses["can1"].log.take()])
        owner.close()
    assert len(logs[0]) == 50 and logs[0] == logs[1]


def test_a_slow_client_loses_frames_gets_a_report_and_delays_no_other_client(owner):
    slow, _ = owner.attached()
    tap = owner.server.peers[0].tap
    per_frame = len(wire.frame_record(wire.FRAME, 0, 0, 0, 0, 0))
    flood = [(1, owner.time, 0x77, 8, 0, 0)] * (3 * LIMITS["attach"].backlog // per_frame)
    for _ in range(4):  # more than any socket holds
        tap.events += flood
        owner.run()
    lost = owner.server.counters()["frames_dropped"]
    assert lost > 0
    received, rest = [], bytearray()
    while more := said(slow, rest):
        received += more
        owner.run()
    owner.buses["can1"].request(0, 1, owner.time, 0x78, 0, 0, 0)
    owner.run(10)
    received += said(slow, rest)
    assert len(frames_of(received)) + lost == 4 * len(flood) + 1
    assert [wire.OVERFLOW_BODY.unpack(body)[1] for kind, body in received if kind == wire.OVERFLOW][-1] == lost
    assert frames_of(received)[-1][1] == 0x78


# --- refusals -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (hello("can1", version=2), b"protocol version 2 is asked for"),
        (hello("can7"), b"no channel 'can7'; it has can1, can2"),
        (hello("can1", magic=b"HTTP"), b"without the protocol's name"),
        (b"GET / HTTP/1.1\r\n\r\n", b"bytes is outside 1 ... 1024"),
        (wire.record(wire.HELLO, b"RN"), b"too short"),
        (wire.record(wire.HELLO, wire.HELLO_BODY.pack(wire.MAGIC, 1, 0) + b"\xff\xfe"), b"not UTF-8"),
        (wire.send_record(1, 0, 0, 0), b"before HELLO"),
        (hello("can1") + hello("can1"), b"a second HELLO"),
        (hello("can1") + wire.record(77), b"type 77 is not for a client"),
        (hello("can1") + wire.record(wire.SEND, b"12"), b"a body of 2 bytes is too short for a frame"),
        (hello("can1") + wire.send_record(0x800, 0, 0, 0), b"0x800 is above 0x7ff"),
        (hello("can1") + wire.send_record(1 << 29, FLAG_EXTENDED, 0, 0), b"is above 0x1fffffff"),
        (hello("can1") + wire.send_record(1, 9, 0, 0), b"not a classic data or remote frame"),
        (hello("can1") + wire.send_record(1, 0x80, 0, 0), b"not a classic data or remote frame"),
        (hello("can1") + wire.record(wire.CONTROL, b"\x09"), b"control 9"),
        (hello("can1") + wire.send_record(1, 0, 0, 0) * (TRANSMIT_QUEUE + 1), b"more than the window of 64"),
    ],
)
def test_a_client_that_breaks_the_rules_gets_the_reason_and_is_closed(owner, data, words):
    client = owner.connect()
    client.sendall(data)
    owner.run(3)
    kind, body = said(client)[-1]
    assert kind == wire.REFUSED and words in body
    assert client.recv(1) == b""
    owner.run(50)
    assert owner.server.counters()["clients"] == 0 and not owner.server.peers


def test_a_name_can_be_taken_once_and_again_when_it_is_free():
    owner = Owner()
    with pytest.raises(UserError, match=f"name '{owner.name}' is taken"):
        AttachServer(owner.name, {})
    owner.close()
    AttachServer(owner.name, {}).close()


@pytest.mark.parametrize("name", ["", "a/b", "a b", "x" * 65, "ä"])
def test_an_impossible_name_is_reported(name):
    with pytest.raises(UserError, match="is not 1 ... 64 letters"):
        AttachServer(name, {})


def test_on_other_systems_than_linux_the_reason_is_reported(monkeypatch):
    monkeypatch.setattr(sys, "platform", "darwin")
    with pytest.raises(UserError, match="exist on Linux only, this is darwin"):
        AttachServer("x", {})


def test_a_client_on_a_bus_keeps_its_place_and_one_more_is_refused(owner):
    places = LIMITS["attach"].peers
    clients = []
    for _ in range(places):
        owner.run(4)  # a connection and its HELLO cost 5 requests, and there is one in 31 us
        clients.append(owner.attached()[0])
    extra = owner.connect()
    owner.run(10)
    ((kind, body),) = said(extra)
    assert kind == wire.REFUSED and b"has 16 clients already" in body
    assert owner.server.counters()["sent_away_full"] == 1
    clients[0].close()
    owner.run(10)
    owner.attached()


def test_a_client_that_has_not_sent_hello_gives_up_its_place_to_another(owner):
    silent = [owner.connect() for _ in range(LIMITS["attach"].peers)]
    owner.run(400)
    owner.attached()
    assert owner.server.counters()["sent_away_idle"] == 1
    ((kind, body),) = said(silent[0])
    assert kind == wire.REFUSED and b"not begun to take part" in body


def test_nothing_is_left_in_the_kernels_list_when_it_ends():
    with hosted("can1") as (name, _):
        assert name in wire.names_running()
    assert name not in wire.names_running()


def test_a_listener_at_the_address_that_is_not_a_robot_is_reported():
    name = fresh_name()
    impostor = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    impostor.bind(wire.SOCKET_PREFIX + name)
    impostor.listen()
    with pytest.raises(UserError, match="is running but has not answered for 0.01 s"):
        attached_link.handshake(name, "can1", patience_s=0.01)
    impostor.close()
    with pytest.raises(FileNotFoundError):
        attached_link.handshake(name, "can1")


def test_a_frame_directly_behind_the_welcome_is_not_forgotten():
    name = fresh_name()
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(wire.SOCKET_PREFIX + name)
        listener.listen()
        listener.settimeout(PATIENCE_S)
        welcome = wire.record(wire.WELCOME, wire.WELCOME_BODY.pack(1, 64, RATE, 0) + b"can1")
        frame = wire.frame_record(wire.FRAME, 5, 0x77, 0, 0, 0)

        def answer():
            connection, _ = listener.accept()
            connection.sendall(welcome + frame)
            connections.append(connection)

        connections = []
        thread = threading.Thread(target=answer, daemon=True)
        thread.start()
        link = attached_link.AttachedLink(name, "can1")
        thread.join(PATIENCE_S)
        assert connections, "the connection is never answered"
        assert link.receive(0) == (RECEIVED, 5, 0x77, 0, 0, 0)
        link.close()
        connections[0].close()


def test_a_host_naps_no_longer_than_its_servers_are_patient(monkeypatch):
    naps = []
    monkeypatch.setattr(host_module.descriptors, "wait", lambda read, write, nap: naps.append(nap))
    host = BusHost([PacedBus("can1")])
    host.serve(AttachServer(fresh_name(), {"can1": host.buses[0].taps}))
    host.turn(0.5)
    monkeypatch.setattr(host.servers[0], "patience_s", lambda: 0.1)
    host.turn(0.5)
    host.close()
    assert naps == [0.5, 0.1]


def test_a_host_reads_of_its_clients_before_it_passes_time_and_not_behind(monkeypatch):
    """A frame that is read behind the last advance would wait for the end of the nap."""
    monkeypatch.setattr(host_module.descriptors, "wait", lambda read, write, nap: None)
    bus = PacedBus("can1")
    host = BusHost([bus])
    steps = []
    monkeypatch.setattr(bus, "advance", lambda: steps.append("advance") or 0)

    class Server:
        def poll(self, now):
            steps.append("poll")

        def deliver(self):
            steps.append("deliver")

        def patience_s(self):
            return 1.0

        def filenos(self):
            return []

        filenos_to_write = filenos

        def close(self):
            pass

    host.serve(Server())
    tap = bus.taps.add("client")
    tap.report_state(0)
    steps.clear()
    host.turn(0.5)
    assert steps == ["advance", "poll", "advance", "deliver"]


# --- fuzz ---------------------------------------------------------------------------------------------------

RECORDS = st.one_of(
    st.binary(max_size=64),
    st.builds(wire.record, st.integers(0, 255), st.binary(max_size=40)),
    st.builds(hello, st.sampled_from(["can1", "can2", "", "can3"]), st.integers(0, 3)),
    st.builds(
        wire.send_record,
        st.integers(0, 2**32 - 1),
        st.integers(0, 2**16 - 1),
        st.integers(0, 2**32 - 1),
        st.integers(0, 2**32 - 1),
    ),
    st.builds(wire.send_record, st.integers(0, 0x7FF), st.sampled_from([0, 3, 8, FLAG_REMOTE]), st.just(1), st.just(2)),
    st.builds(lambda wish: wire.record(wire.CONTROL, bytes([wish])), st.integers(0, 4)),
    st.builds(lambda length: struct.pack("<I", length), st.integers(0, 2**32 - 1)),
)


@given(st.lists(st.tuples(RECORDS, st.booleans(), st.booleans()), max_size=30), st.booleans())
def test_whatever_clients_send_the_server_and_the_other_nodes_live_on(pieces, handshake):
    owner = Owner()
    good, _ = owner.attached()
    bad = owner.attached()[0] if handshake else owner.connect()
    for piece, leaves, waits in pieces:
        try:
            bad.sendall(piece)
        except OSError:  # closed by the server: as it should be
            bad = owner.connect()
        if leaves:
            bad.close()
            bad = owner.connect()
        if waits:
            owner.run()
    owner.run(5)
    said(good)
    good.send(wire.send_record(0, 1, 0x5A, 0))
    owner.run(1000)
    assert [frame[1:4] for frame in frames_of(said(good), wire.SENT)] == [(0, 1, 0x5A)]
    received = []
    inbox = owner.inboxes["can1"]
    while inbox.take():
        received.append((inbox.b, inbox.d))
    assert (0, 0x5A) in received
    owner.close()


def test_half_records_in_any_pieces_are_the_same_as_whole_ones():
    data = hello("can1") + b"".join(wire.send_record(number, 8, number, 0) for number in range(30))
    dice = RandomStream(5, "pieces")
    owner = Owner()
    client = owner.connect()
    while data:
        size = 1 + dice.integer(9)
        client.sendall(data[:size])
        data = data[size:]
        owner.run(2)
    owner.run(200)
    assert [frame[1] for frame in frames_of(said(client), wire.SENT)] == list(range(30))
    owner.close()
