"""Emulated buses for programs without python: serial-line CAN and socketcand, with python-can's clients and by hand."""

import os
import socket

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge.slcan import SlcanServer
from ranger_sim.can_bus.edge.socketcand import SocketcandServer
from ranger_sim.can_bus.edge.taps import ERROR_PASSIVE, TAP_LIMIT, TRANSMIT_QUEUE
from ranger_sim.can_bus.node import RESET
from ranger_sim.foundation import descriptors, wallclock
from ranger_sim.foundation.events import FLAG_EXTENDED, FLAG_REMOTE, STAGE_BUS, EventQueue
from ranger_sim.foundation.user_error import UserError

from .hosting import hosted

RATE = 1_000_000
STEP_NS = 31_250
QUIET_S = 0.05  # the kernel hands on what was written to a terminal a while later, and in pieces


def message(identifier, data=b"", **options):
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=identifier > 0x7FF, **options)


class Owner:
    """A bus with one board, polled together with a server."""

    def __init__(self, make):
        self.bus = Bus("can1", RATE)
        self.inbox = EventQueue(64)
        self.bus.add_node("board", self.inbox, 1, STAGE_BUS * 256)
        self.server = make(self.bus)
        self.time = 0

    def run(self, steps=10):
        for _ in range(steps):
            self.server.poll(self.time)
            self.bus.advance(self.time)
            self.time += STEP_NS

    def received(self):
        found = []
        while self.inbox.take():
            if self.inbox.kind == 2:  # CAN_RX
                found.append((self.inbox.b, self.inbox.c, self.inbox.d, self.inbox.e))
        return found

    def board_sends(self, identifier, flags=8, lo=0, hi=0):
        assert self.bus.request(0, 1, self.time, identifier, flags, lo, hi)
        self.run()


# --- slcan --------------------------------------------------------------------------------------------------


@pytest.fixture
def line():
    """(owner, say): say(text) writes to the pseudo-terminal, lets time pass and returns the answer."""
    owner = Owner(lambda bus: SlcanServer("can1", bus))
    end = os.open(owner.server.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def say(text=""):
        os.write(end, text.encode("latin-1"))
        owner.run()
        answer = b""
        while ready := descriptors.wait([end, *owner.server.filenos()], [], QUIET_S)[0]:
            if end in ready:
                answer += os.read(end, 1 << 16)
            owner.run()
        return answer.decode()

    yield owner, say
    os.close(end)
    owner.server.close()


def test_slcan_commands_have_the_answers_of_the_protocol(line):
    _, say = line
    assert say("V\r") == "V0101\r"
    assert say("N\r") == "NRSIM\r"
    assert say("S6\r") == "\r"
    assert say("t1230\r") == "\a"  # closed
    assert say("O\r") == "\r"
    assert say("O\r") == "\a"  # open already
    assert say("t12321122\r") == "z\r"
    assert say("T000001230\r") == "Z\r"
    assert say("F\r") == "F00\r"
    assert say("C\r") == "\r"


@pytest.mark.parametrize(
    ("length", "answer"), [(31, "Z\r"), (32, "Z\r"), (33, "\a"), (64, "\a"), (65, "\a"), (200, "\a")]
)
def test_slcan_a_command_has_32_bytes_at_most_and_the_next_one_is_read(line, length, answer):
    """An extended frame has 26 and may carry a stamp behind it; a longer line is not a command, at any length."""
    _, say = line
    say("O\r")
    frame = "T0000012380102030405060708"
    reported = say(frame + "0" * (length - len(frame)) + "\r")
    assert reported == answer if length > 32 else reported in (answer, "\a")
    assert say("V\r") == "V0101\r"


def test_slcan_flags_are_bit_5_for_a_passive_controller_and_bit_7_for_one_off_the_bus(line):
    owner, say = line
    say("O\r")
    owner.server.program.tap.counters = (0, 128)
    assert owner.server.program.tap.state == ERROR_PASSIVE and owner.server._status() == 0x20
    owner.server.program.tap.off = True
    assert owner.server._status() == 0x80


def test_slcan_a_bus_without_a_place_is_refused_and_counted_and_opening_twice_is_not(line):
    owner, say = line
    others = [owner.server.taps.add(f"other {number}") for number in range(TAP_LIMIT)]
    assert say("O\r") == "\a" and owner.server.sent_away == {"full": 1}
    owner.server.taps.remove(others[0])
    assert say("O\r") == "\r" and say("O\r") == "\a" and owner.server.sent_away == {"full": 1}


def test_slcan_frames_are_lines(line):
    owner, say = line
    say("O\r")
    say("t1232AABB\rT1FFFFFFF8\rr7FF4\rR000008001\rT000008000\r")
    assert owner.received() == [
        (0x123, 2, 0xBBAA, 0),
        (0x7FF, 4 | FLAG_REMOTE, 0, 0),
        (0x800, 1 | FLAG_EXTENDED | FLAG_REMOTE, 0, 0),
        (0x800, FLAG_EXTENDED, 0, 0),
    ]
    owner.board_sends(0x123, 3, 0x030201)
    owner.board_sends(0x1ABCDEF0, 2 | FLAG_EXTENDED, 0x1234)
    owner.board_sends(0x001, 5 | FLAG_REMOTE)
    assert say() == "t1233010203\rT1ABCDEF023412\rr0015\r"
    say("Z1\r")
    owner.time = 60_123_000_000
    owner.bus.advance(owner.time)
    owner.board_sends(0x2, 0)
    assert say() == "t0020007B\r"  # 60 123 ms, stamps wrap at a minute


def test_slcan_listen_only_sends_nothing_and_receives_everything(line):
    owner, say = line
    owner.bus.add_node("other", EventQueue(8), 1, STAGE_BUS * 256 + 1)
    assert say("L\r") == "\r"
    assert say("t1230\r") == "\a"
    owner.board_sends(0x10, 0)
    assert say() == "t0100\r"


def test_slcan_a_program_that_does_not_read_loses_frames_and_gets_a_report(line):
    owner, say = line
    say("O\r")
    tap = owner.server.program.tap
    tap.events += [(1, 0, 0x123, 8, 0, 0)] * 10_000
    owner.run(1)
    assert owner.server.counters()["frames_dropped"] > 0
    shown = ""
    while text := say():
        shown += text
    assert shown.endswith("t12380000000000000000\r")
    assert say("F\r") == "F01\r" and say("F\r") == "F00\r"


@given(st.lists(st.one_of(st.binary(max_size=40), st.sampled_from([b"O\r", b"C\r", b"t12380011223344556677\r"]))))
def test_slcan_whatever_comes_over_the_line_the_server_lives_on(pieces):
    owner = Owner(lambda bus: SlcanServer("can1", bus))
    end = os.open(owner.server.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    for piece in pieces:
        os.write(end, piece)
        owner.run(2)
        try:
            os.read(end, 1 << 16)
        except BlockingIOError:
            pass
    os.write(end, b"\r\rC\rO\r")
    owner.run(300)
    owner.received()
    os.write(end, b"t0011AA\r")
    owner.run(10)
    assert owner.received() == [(1, 1, 0xAA, 0)]
    os.close(end)
    owner.server.close()


def test_python_cans_slcan_client_meets_the_others():
    servers = (lambda taps: SlcanServer("can1", taps["can1"]),)
    with hosted("can1", servers=servers) as (name, host):
        path = host.servers[1].path
        with (
            can.Bus(interface="slcan", channel=path, sleep_after_open=0, ignore_config=True) as serial,
            can.Bus(interface="ranger_sim", channel=f"{name}/can1", ignore_config=True) as other,
        ):
            assert serial.get_version(60) == (1, 1)
            for number in range(30):
                serial.send(message(0x100 + number, bytes([number])))
                assert other.recv(60).arbitration_id == 0x100 + number
                other.send(message(0x12340000 + number, b"\x01" * (number % 9)))
                got = serial.recv(60)
                assert (got.arbitration_id, got.is_extended_id) == (0x12340000 + number, True)
                assert bytes(got.data) == b"\x01" * (number % 9)
            serial.send(message(0x7, is_remote_frame=True, dlc=4))
            got = other.recv(60)
            assert got.is_remote_frame and got.dlc == 4


# --- socketcand ---------------------------------------------------------------------------------------------


@pytest.fixture
def daemon(monkeypatch):
    """(owner, connect): connect() gives say(text) over its own connection."""
    clock = [0.0]
    monkeypatch.setattr(wallclock, "monotonic_s", lambda: clock[0])
    owner = Owner(lambda bus: SocketcandServer({"can1": bus}, 0))
    owner.clock = clock
    clients = []

    def connect():
        client = socket.create_connection(("127.0.0.1", owner.server.port))
        client.setblocking(False)
        clients.append(client)

        def say(text=""):
            client.sendall(text.encode("latin-1"))
            owner.run()
            try:
                return client.recv(1 << 16).decode()
            except BlockingIOError:
                return ""

        return say

    yield owner, connect
    owner.server.close()
    for client in clients:
        client.close()


def test_socketcand_messages_have_the_answers_of_the_protocol(daemon):
    owner, connect = daemon
    say = connect()
    assert say() == "< hi >"
    assert say("< echo >") == "< echo >"
    assert say("< open can1 >") == "< ok >"
    assert say("< rawmode >") == "< ok >"
    owner.clock[0] = 1.0
    assert say("< send 123 2 a 1b >< send 00000123 0 >") == ""
    assert owner.received() == [(0x123, 2, 0x1B0A, 0), (0x123, FLAG_EXTENDED, 0, 0)]
    owner.board_sends(0x5, 3, 0x030201)
    owner.board_sends(0x1ABCDEF0, FLAG_EXTENDED)
    owner.board_sends(0x6, 3 | FLAG_REMOTE)
    first, second = say().replace("><", ">|<").split("|")
    assert first.startswith("< frame 005 0.") and first.endswith(" 010203 >")
    assert second.startswith("< frame 1ABCDEF0 0.") and second.endswith("  >")
    assert owner.server.counters()["not_carried"] == 1


def test_socketcand_frames_beyond_a_full_queue_are_counted(daemon):
    owner, connect = daemon
    say = connect()
    say("< open can1 >< rawmode >")
    owner.bus.set_mode(0, RESET, owner.time)  # nobody acknowledges
    [tap] = owner.server.channels["can1"].taps
    while tap.queued < TRANSMIT_QUEUE:
        tap.offer(0x7, 0, 0, 0)
    say("< send 123 0 >" * 3)
    assert (owner.server.counters()["frames_in"], owner.server.counters()["refused"]) == (0, 3)


def test_socketcand_nothing_follows_the_answer_to_rawmode_at_once(daemon):
    owner, connect = daemon
    say = connect()
    say("< open can1 >")
    assert say("< rawmode >").endswith("< ok >")
    owner.board_sends(0x5, 0)
    assert say() == "" and owner.server.patience_s() > 0.0
    owner.clock[0] = 0.11
    assert say().startswith("< frame 005 ")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("< open can9 >", "could not open bus (available: can1)"),
        ("< rawmode >", "rawmode is not understood"),
        ("< open can1 >< bcmmode >", "bcmmode is not understood"),
        ("< open can1 >< rawmode >< send 800 0 >", "impossible identifier"),
        ("< open can1 >< rawmode >< send 123 2 1 >", "impossible identifier or length"),
        ("< open can1 >< rawmode >< send x y >", "a send is"),
        ("< open can1 >< rawmode >< send 1 1 100 >", "a send is"),
        ("GET / HTTP/1.1", "no message in angle brackets"),
        ("< " + "x" * 300, "sent a request above the limit"),
        ("< send < 1 0 >", "no message in angle brackets"),
        ("< >", "an empty message"),
    ],
)
def test_socketcand_an_unknown_request_is_reported(daemon, text, words):
    _, connect = daemon
    say = connect()
    said = say(text)
    assert "< error " in said and words in said


@given(
    st.lists(
        st.one_of(
            st.binary(max_size=60),
            st.sampled_from(
                [b"< open can1 >", b"< rawmode >", b"< send 123 1 ff >", b"< send ", b">", b"< send -1 0 >", b"<<<"]
            ),
        ),
        max_size=20,
    )
)
def test_socketcand_whatever_clients_send_the_server_and_the_others_live_on(pieces):
    owner = Owner(lambda bus: SocketcandServer({"can1": bus}, 0))
    address = ("127.0.0.1", owner.server.port)
    with socket.create_connection(address) as good, socket.create_connection(address) as bad:
        good.sendall(b"< open can1 >< rawmode >")
        owner.run(2)
        for piece in pieces:
            try:
                bad.sendall(piece)
            except OSError:  # closed by the server: as it should be
                break
            owner.run(2)
        owner.run(300)
        owner.received()
        good.sendall(b"< send 001 1 aa >")
        while not (received := owner.received()):
            owner.run(10)
        assert received == [(1, 1, 0xAA, 0)]
    owner.server.close()


def test_a_port_that_cannot_be_opened_is_reported():
    owner = Owner(lambda bus: SocketcandServer({"can1": bus}, 0))
    with pytest.raises(UserError, match=f"socketcand on 127.0.0.1:{owner.server.port}: Address already in use"):
        SocketcandServer({}, owner.server.port)
    with pytest.raises(UserError, match="socketcand on 127.0.0.1:70000"):
        SocketcandServer({}, 70000)
    owner.server.close()


def test_python_cans_socketcand_client_meets_the_others():
    servers = (lambda taps: SocketcandServer(taps, 0),)
    with hosted("can1", "can2", servers=servers) as (name, host):
        port = host.servers[1].port
        with (
            can.Bus(interface="socketcand", channel="can2", host="127.0.0.1", port=port, ignore_config=True) as remote,
            can.Bus(interface="ranger_sim", channel=f"{name}/can2", ignore_config=True) as other,
        ):
            for number in range(30):
                remote.send(message(0x100 + number, bytes([number])))
                assert other.recv(60).arbitration_id == 0x100 + number
                other.send(message(0x12340000 + number, b"\x01" * (number % 9)))
                got = remote.recv(60)
                assert (got.arbitration_id, got.is_extended_id) == (0x12340000 + number, True)
                assert bytes(got.data) == b"\x01" * (number % 9)
