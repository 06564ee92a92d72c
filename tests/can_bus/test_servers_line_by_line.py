"""What the servers of a bus answer to each command, and how they report each event: bytes and counts, without waiting.

Requests are laid where the terminal or the connection would put them, and answers taken from where they wait.
"""

import math
import socket
import struct

import pytest

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge.attach import AttachServer
from ranger_sim.can_bus.edge.peers import LIMITS
from ranger_sim.can_bus.edge.slcan import SlcanServer
from ranger_sim.can_bus.edge.socketcand import SocketcandServer
from ranger_sim.can_bus.edge.taps import DROPPED, RECEIVED, SENT, STATE, TRANSMIT_QUEUE, Taps
from ranger_sim.can_bus.node import RESET
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE, STAGE_BUS, EventQueue
from ranger_sim.foundation.user_error import UserError

from .hosting import fresh_name

MS = 1_000_000
COUNTS = ("clients", "clients_seen", "frames_in", "frames_out", "frames_dropped", "malformed", "refused")
REASONS = ("full", "foreign", "unknown", "malformed", "too_long", "stalled", "idle")


def counted(server, **others):
    """Every counter of the server is 0 but for these."""
    names = [*COUNTS, *(f"sent_away_{each}" for each in REASONS)]
    names += ["not_carried"] if isinstance(server, SocketcandServer) else []
    assert server.counters() == {**dict.fromkeys(names, 0), **others}


def lone_bus(name="can1"):
    """A bus with one board."""
    bus = Bus(name, 1_000_000)
    bus.add_node("board", EventQueue(64), 1, STAGE_BUS * 256)
    return bus


# ---- slcan


class Line:
    """An adapter: `say` gives it characters and returns its answers."""

    def __init__(self, epoch_ns=0):
        self.bus = lone_bus()
        self.server = SlcanServer("can1", self.bus, epoch_ns)
        self.program = self.server.program

    def say(self, text):
        self.program.incoming += text.encode("latin-1")
        while self.server._take(self.program):
            pass
        return self.taken()

    def taken(self):
        found = bytes(self.program.outgoing).decode()
        self.program.outgoing.clear()
        return found

    def tells(self, *events):
        self.program.tap.events += events
        self.server._report(self.program)
        assert self.program.tap.events == []
        return self.taken()

    def queued(self):
        found = list(self.program.tap.waiting)
        self.program.tap.waiting.clear()
        return found


@pytest.fixture
def line():
    each = Line()
    yield each
    each.server.close()


@pytest.mark.parametrize(
    "text",
    ["S6", "s031C", "X1", "M00000000", "m1FFFFFFF", "Yf", "U1", "QA", "W0", "P9", "Z0", "Z1", "C", "S" + "0" * 31],
)
def test_slcan_what_has_no_effect_on_an_emulated_bus_is_acknowledged(line, text):
    assert line.say(text + "\r") == "\r"
    counted(line.server)


@pytest.mark.parametrize(
    "text",
    [
        "S", "Sg", "S6 ", "X", "Mxy", "P", "Z", "Z2", "Z01", "V1", "v0", "N0", "F1", "C0", "O1", "L0", "A", "z", " ",
        "o", "t", "t12", "t123", "T0000001", "T00000012", "r", "R1234567",
        "t8000", "r8000", "T200000000", "R200000000",
        "t1239" + "00" * 9, "t123a", "t1231", "t12311", "t1231112", "t12g0", "t1232112g", "t1230 ", "r12312",
        "r1239", "R000000010 ", "R0000000122", "T000000012g0",
    ],
)  # fmt: skip
def test_slcan_an_unknown_command_is_a_bell_and_counted(line, text):
    line.say("O\r")
    assert line.say(text + "\r") == "\a"
    counted(line.server, clients=1, clients_seen=1, malformed=1)
    assert line.queued() == []


def test_slcan_version_number_and_flags_of_a_closed_adapter(line):
    assert line.say("V\rv\rN\rF\r") == "V0101\rv0101\rNRSIM\rF00\r"


@pytest.mark.parametrize(
    ("text", "answer", "frame"),
    [
        ("t0000", "z", (0, 0, 0, 0)),
        ("t7FF0", "z", (0x7FF, 0, 0, 0)),
        ("t1238" + "0102030405060708", "z", (0x123, 8, 0x04030201, 0x08070605)),
        ("t1235aAbBcCdDeE", "z", (0x123, 5, 0xDDCCBBAA, 0xEE)),
        ("T1fffffff1FF", "Z", (0x1FFFFFFF, 1 | FLAG_EXTENDED, 0xFF, 0)),
        ("T000007FF0", "Z", (0x7FF, FLAG_EXTENDED, 0, 0)),
        ("r7FF8", "z", (0x7FF, 8 | FLAG_REMOTE, 0, 0)),
        ("R1FFFFFFF3", "Z", (0x1FFFFFFF, 3 | FLAG_REMOTE | FLAG_EXTENDED, 0, 0)),
    ],
)
def test_slcan_a_frame_is_queued_as_it_is_written(line, text, answer, frame):
    assert line.say(text + "\r") == "\a"  # the adapter is closed: a right command that is refused
    counted(line.server, refused=1)
    assert line.say("O\r") == "\r"
    assert line.say(text + "\r") == answer + "\r"
    assert line.queued() == [frame]
    counted(line.server, clients=1, clients_seen=1, refused=1, frames_in=1)


def test_slcan_a_frame_for_a_full_queue_is_refused(line):
    line.say("O\r")
    assert line.say("t1230\r" * (TRANSMIT_QUEUE + 2)) == "z\r" * TRANSMIT_QUEUE + "\a\a"
    counted(line.server, clients=1, clients_seen=1, refused=2, frames_in=TRANSMIT_QUEUE)


def test_slcan_an_adapter_is_opened_once_and_closed_as_often_as_one_likes(line):
    assert line.say("C\rO\rO\rL\rC\rC\rL\r") == "\r\r\a\a\r\r\r"
    counted(line.server, clients=1, clients_seen=2, refused=2)
    assert line.program.tap.silent and line.program.tap.name == "can1 slcan"
    assert line.say("t1230\r") == "\a"
    assert line.say("C\rO\r") == "\r\r" and not line.program.tap.silent


def test_slcan_a_bus_without_a_place_is_one_more_reason(line):
    others = []
    while not line.server.taps.full:
        others.append(line.server.taps.add("other"))
    assert line.say("O\rL\r") == "\a\a"
    counted(line.server, refused=2, sent_away_full=2)
    line.server.taps.remove(others[0])
    assert line.say("O\rO\r") == "\r\a"  # the second: it is open
    counted(line.server, clients=1, clients_seen=1, refused=3, sent_away_full=2)


def test_slcan_the_path_leads_to_the_adapter(line):
    assert line.server.path == line.program.stream.path
    assert line.server.filenos() == [line.program.stream.fileno()]


def test_slcan_lines_may_come_in_pieces_and_empty_ones_are_ignored(line):
    assert line.say("V") == "" and line.say("\rN") == "V0101\r" and line.say("\r\r\r") == "NRSIM\r"
    assert line.say("\nV\n\r\n\r") == "V0101\r"
    counted(line.server)


@pytest.mark.parametrize(("length", "answer"), [(30, "\r"), (31, "\r"), (32, "\a"), (33, "\a"), (90, "\a")])
def test_slcan_31_characters_wait_for_their_end_and_more_are_given_up(line, length, answer):
    """LIMITS has 32 bytes for a command: so many that still have no end are forgotten, and a bell reports it then."""
    assert LIMITS["slcan"].longest == 32
    assert line.say("S" + "0" * (length - 1)) == ""
    assert len(line.program.incoming) == (length if length < 32 else 0)
    assert line.say("\r") == answer and line.say("V\r") == "V0101\r"
    counted(line.server, malformed=int(answer == "\a"))


@pytest.mark.parametrize(("length", "answer"), [(32, "\r"), (33, "\a")])
def test_slcan_a_whole_command_has_32_characters_at_most(line, length, answer):
    assert line.say("S" + "0" * (length - 1) + "\rV\r") == answer + "V0101\r"
    counted(line.server, malformed=int(answer == "\a"))


@pytest.mark.parametrize(
    ("event", "text"),
    [
        ((RECEIVED, 0, 0x001, 0, 0, 0), "t0010\r"),
        ((RECEIVED, 0, 0x7FF, 8, 0x04030201, 0x08070605), "t7FF80102030405060708\r"),
        ((RECEIVED, 0, 0x12, 5, 0xFFFFFFFF, 0xFFFFFF0A), "t0125FFFFFFFF0A\r"),
        ((RECEIVED, 0, 0x1ABCDEF, 1 | FLAG_EXTENDED, 0xAB, 0), "T01ABCDEF1AB\r"),
        ((RECEIVED, 0, 0x12, 3 | FLAG_REMOTE, 0, 0), "r0123\r"),
        ((RECEIVED, 0, 0x12, 3 | FLAG_REMOTE | FLAG_EXTENDED, 0, 0), "R000000123\r"),
        ((RECEIVED, 0, 0x12, 13, 0, 0), "t01280000000000000000\r"),  # length codes above eight mean eight
        ((RECEIVED, 0, 0x12, 13 | FLAG_REMOTE, 0, 0), "r0128\r"),
        ((RECEIVED, 0, 0x204, 8 | FLAG_ERROR, 0, 0), ""),
        ((SENT, 0, 0x12, 0, 0, 0), ""),
        ((DROPPED, 0, 0x12, 0, 0, 0), ""),
        ((STATE, 0, 1, 128, 0, 0), ""),
    ],
)
def test_slcan_what_happens_on_the_bus_is_a_line_if_it_is_a_frame(line, event, text):
    line.server._report(line.program)  # closed: nothing to tell
    line.say("O\r")
    assert line.tells(event) == text
    assert line.tells(event, event) == text + text
    counted(line.server, clients=1, clients_seen=1, frames_out=3 if text else 0)


@pytest.mark.parametrize(
    ("time", "stamp"),
    [
        (0, "0000"),
        (999_999, "0000"),
        (MS, "0001"),
        (59_999 * MS, "EA5F"),
        (60_000 * MS, "0000"),
        (3_600_001 * MS, "0001"),
    ],
)
@pytest.mark.parametrize("epoch", [0, 120_000 * MS])
def test_slcan_stamps_are_milliseconds_of_a_minute(time, stamp, epoch):
    line = Line(epoch)
    line.say("O\rZ1\r")
    event = (RECEIVED, time, 0x1, 1, 0xFF, 0)
    assert line.tells(event) == f"t0011FF{stamp}\r"
    line.say("Z0\r")
    assert line.tells(event) == "t0011FF\r"
    line.server.close()


def test_slcan_the_epoch_moves_stamps():
    line = Line(epoch_ns=1_999_999)
    line.say("O\rZ1\r")
    assert line.tells((RECEIVED, 1, 0x1, 0, 0, 0)) == "t00100002\r"
    line.server.close()


def test_slcan_frames_beyond_the_backlog_are_left_out_and_reported_once(line):
    line.say("O\r")
    event = (RECEIVED, 0, 0x1, 0, 0, 0)
    line.program.outgoing += bytes(LIMITS["slcan"].backlog - len("t0010\r"))
    assert line.tells(event, event, event)[-6:] == "t0010\r"
    counted(line.server, clients=1, clients_seen=1, frames_out=1, frames_dropped=2)
    assert line.say("F\rF\r") == "F01\rF00\r"


@pytest.mark.parametrize(
    ("counters", "off", "silent", "reported"),
    [
        ((0, 0), False, False, "F00"),
        ((127, 127), False, False, "F00"),
        ((128, 0), False, False, "F20"),
        ((0, 128), False, False, "F20"),
        ((200, 0), True, False, "F80"),
        ((200, 0), False, True, "F00"),
    ],
)
def test_slcan_flags_show_the_state_of_the_controller(line, counters, off, silent, reported):
    line.say("O\r")
    tap = line.program.tap
    tap.counters, tap.off, tap.silent = counters, off, silent
    line.server.overrun = True
    assert line.say("F\rF\r") == f"F{int(reported[1:], 16) | 1:02X}\r{reported}\r"
    tap.silent = False


def test_slcan_a_program_that_is_sent_away_leaves_a_fresh_terminal(line):
    line.say("O\r")
    tap = line.program.tap
    tap.offer(1, 0, 0, 0)
    line.program.incoming += b"rest"
    line.program.answer(b"answer")
    line.program.wants_since_s = 1.0
    line.server.send_away(line.program, "stalled")
    program = line.program
    assert (program.tap, bytes(program.incoming), bytes(program.outgoing)) == (None, b"", b"")
    assert (program.answers, program.wants_since_s) == (0, None)
    assert not tap.waiting and tap not in line.server.taps.taps
    counted(line.server, clients_seen=1, sent_away_stalled=1)
    line.server.send_away(line.program, "malformed")  # closed already
    counted(line.server, clients_seen=1, sent_away_stalled=1, sent_away_malformed=1)
    assert line.say("O\r") == "\r"


# ---- socketcand


class Daemon:
    """A server on a port, with its clock in `clock_s`; `client()` is one that has connected."""

    def __init__(self, epoch_ns=0, **buses):
        self.buses = buses or {"can1": lone_bus()}
        self.server = SocketcandServer(self.buses, 0, epoch_ns=epoch_ns)
        self.clock_s = 10.0
        self.server.clock = lambda: self.clock_s
        self.ends = []

    def client(self):
        end, other = socket.socketpair()
        self.ends.append(other)
        client = self.server._welcome(end)
        self.server.let_in(client)
        assert self.taken(client) == "< hi >"
        return client

    @staticmethod
    def taken(client):
        found = bytes(client.outgoing).decode()
        client.outgoing.clear()
        return found

    def say(self, client, text):
        client.incoming += text.encode("latin-1")
        while self.server._take(client):
            pass
        return self.taken(client)

    def opened(self, channel="can1"):
        client = self.client()
        assert self.say(client, f"< open {channel} >< rawmode >") == "< ok >< ok >"
        self.clock_s += 1.0
        return client

    def tells(self, client, *events):
        self.server.texts.clear()
        client.tap.events += events
        self.server._report(client)
        return self.taken(client)

    def close(self):
        self.server.close()
        for end in self.ends:
            end.close()


@pytest.fixture
def daemon():
    each = Daemon()
    yield each
    each.close()


@pytest.mark.parametrize(
    ("text", "frame"),
    [
        ("send 0 0", (0, 0, 0, 0)),
        ("send 7ff 8 1 2 3 4 5 6 7 8", (0x7FF, 8, 0x04030201, 0x08070605)),
        ("send 1 3 ff FE 0a", (1, 3, 0x0AFEFF, 0)),
        ("send 0001 1 0", (1, 1 | FLAG_EXTENDED, 0, 0)),  # more than three digits
        ("send 1FFFFFFF 2 0 1", (0x1FFFFFFF, 2 | FLAG_EXTENDED, 0x0100, 0)),
    ],
)
def test_socketcand_a_send_is_queued_as_it_is_written(daemon, text, frame):
    client = daemon.opened()
    assert daemon.say(client, f"<{text}>") == ""
    assert list(client.tap.waiting) == [frame]
    counted(daemon.server, clients=1, clients_seen=1, frames_in=1)


@pytest.mark.parametrize(
    "text",
    [
        "send", "send 1", "send g 0", "send 1 g", "send 1 1 g", "send 1 1 100", "send 1 1 -1", "send 800 0",
        "send 20000000 0", "send -1 0", "send 1 9 0 0 0 0 0 0 0 0 0", "send 1 1", "send 1 0 0", "send 1 2 1",
        "echo 1", "rawmode", "rawmode 1", "open", "open can1", "open can1 can1", "sent 1 0", "", "hello",
    ],
)  # fmt: skip
def test_socketcand_an_unknown_request_is_reported_and_counted(daemon, text):
    client = daemon.opened()
    reported = daemon.say(client, f"< {text} >< echo >")
    assert reported.startswith("< error ") and reported.endswith(" >< echo >")
    counted(daemon.server, clients=1, clients_seen=1, malformed=1)
    assert not client.tap.waiting


@pytest.mark.parametrize("text", ["send 1 0", "rawmode"])
def test_socketcand_nothing_is_sent_or_received_before_a_bus_is_open(daemon, text):
    client = daemon.client()
    assert daemon.say(client, f"< {text} >").startswith("< error ")
    counted(daemon.server, malformed=1)
    assert daemon.say(client, "< open can1 >< send 1 0 >").startswith("< ok >< error ")
    counted(daemon.server, malformed=2)


def test_socketcand_messages_may_come_in_pieces_with_space_around_them(daemon):
    client = daemon.client()
    assert daemon.say(client, " \n< ec") == ""
    assert daemon.say(client, "ho >\r\n <echo") == "< echo >"
    assert daemon.say(client, ">  ") == "< echo >"
    assert not client.incoming and not client.ending


def test_socketcand_a_bus_that_is_not_there_ends_the_connection(daemon):
    client = daemon.client()
    assert daemon.say(client, "< open can7 >") == "< error could not open bus (available: can1) >"
    assert client.ending
    counted(daemon.server, refused=1, sent_away_malformed=1)


@pytest.mark.parametrize("text", ["x", "GET /", "< < ", "< a < b >"])
def test_socketcand_a_client_of_another_protocol_gets_the_reason_and_is_sent_away(daemon, text):
    client = daemon.client()
    assert daemon.say(client, text) == "< error that is no message in angle brackets >"
    assert client.ending
    counted(daemon.server, malformed=1, sent_away_malformed=1)


def test_socketcand_a_full_bus_has_no_place_and_a_full_queue_no_word(daemon):
    taps = daemon.server.channels["can1"]
    client = daemon.opened()
    while not taps.full:
        taps.add("other")
    late = daemon.client()
    assert daemon.say(late, "< open can1 >< rawmode >").startswith("< ok >< error ")
    counted(daemon.server, clients=1, clients_seen=1, sent_away_full=1)
    daemon.buses["can1"].set_mode(0, RESET, 0)
    assert daemon.say(client, "< send 1 0 >" * (TRANSMIT_QUEUE + 3)) == ""
    counted(daemon.server, clients=1, clients_seen=1, sent_away_full=1, frames_in=TRANSMIT_QUEUE, refused=3)


@pytest.mark.parametrize(
    ("event", "text"),
    [
        ((RECEIVED, 0, 0x1, 0, 0, 0), "< frame 001 0.000000  >"),
        ((RECEIVED, 1_234_567_899, 0x7FF, 3, 0xFF030201, 0), "< frame 7FF 1.234567 010203 >"),
        ((RECEIVED, 999_999_999, 0x1AB, 8 | FLAG_EXTENDED, 1, 2), "< frame 000001AB 0.999999 0100000002000000 >"),
        ((RECEIVED, 5_000, 0x204, 8 | FLAG_ERROR, 0, 0), "< error 204 0.000005 >"),
        ((RECEIVED, 0, 0x20000004, 8 | FLAG_ERROR, 0, 0), "< error 004 0.000000 >"),
        ((RECEIVED, 0, 0x1, 0 | FLAG_REMOTE, 0, 0), ""),
        ((SENT, 0, 0x1, 0, 0, 0), ""),
        ((DROPPED, 0, 0x1, 0, 0, 0), ""),
        ((STATE, 0, 0, 0, 0, 0), ""),
    ],
)
def test_socketcand_what_happens_on_the_bus_is_a_message_if_it_is_a_frame(daemon, event, text):
    client = daemon.opened()
    assert daemon.tells(client, event, event) == text + text
    remote = 2 if event[3] & FLAG_REMOTE else 0
    counted(daemon.server, clients=1, clients_seen=1, frames_out=2 if text else 0, not_carried=remote)


def test_socketcand_stamps_count_from_the_epoch():
    daemon = Daemon(epoch_ns=1_700_000_000_123_456_000)
    assert daemon.tells(daemon.opened(), (RECEIVED, 1_000, 1, 0, 0, 0)) == "< frame 001 1700000000.123457  >"
    daemon.close()


def test_socketcand_frames_wait_a_tenth_of_a_second_behind_rawmode(daemon):
    client = daemon.client()
    daemon.say(client, "< open can1 >< rawmode >")
    one, two, three = ((RECEIVED, 0, n, 0, 0, 0) for n in (1, 2, 3))
    daemon.clock_s += 0.0999
    assert daemon.tells(client, one) == "" and daemon.tells(client, two) == ""
    assert daemon.server.patience_s() == 0.1
    daemon.clock_s += 0.0002
    assert daemon.tells(client, three) == "".join(f"< frame 00{n} 0.000000  >" for n in (1, 2, 3))
    assert daemon.server.patience_s() == math.inf
    assert daemon.tells(client, one) == "< frame 001 0.000000  >"
    counted(daemon.server, clients=1, clients_seen=1, frames_out=4)


def test_socketcand_of_what_waits_behind_rawmode_4096_are_kept(daemon):
    client = daemon.client()
    daemon.say(client, "< open can1 >< rawmode >")
    events = [(RECEIVED, 0, n & 0x7FF, 0, 0, 0) for n in range(4_090)]
    assert daemon.tells(client, *events) == ""
    assert daemon.tells(client, *events[:10]) == ""
    counted(daemon.server, clients=1, clients_seen=1, frames_dropped=4)
    daemon.clock_s += 1.0
    shown = daemon.tells(client)
    assert shown.count("frame") == 4_096 and shown.endswith(f"< frame {5:03X} 0.000000  >")


def test_socketcand_frames_beyond_the_backlog_are_left_out(daemon):
    client = daemon.opened()
    client.outgoing += bytes(LIMITS["socketcand"].backlog - len("< frame 001 0.000000  >"))
    shown = daemon.tells(client, *[(RECEIVED, 0, n, 0, 0, 0) for n in (1, 2, 3)])
    assert shown.endswith("\0< frame 001 0.000000  >")
    counted(daemon.server, clients=1, clients_seen=1, frames_out=1, frames_dropped=2)


def test_socketcand_all_clients_of_a_poll_receive_one_text_and_the_next_poll_another(daemon):
    first, second = daemon.opened(), daemon.opened()
    event = (RECEIVED, 7_000, 1, 0, 0, 0)
    for _ in range(2):
        for client in (first, second):
            client.tap.events.append(event)
        daemon.server.poll(0)
        assert [daemon.ends[n].recv(100) for n in (0, 1)] == [b"< frame 001 0.000007  >"] * 2
        assert list(daemon.server.texts) == [event]
    daemon.server.poll(0)
    assert daemon.server.texts == {}


def test_socketcand_a_foreign_network_is_refused_and_its_port_is_free_then():
    with pytest.raises(UserError, match="socketcand on 0.0.0.0:0"):
        SocketcandServer({}, 0, "0.0.0.0")
    server = SocketcandServer({}, 0, "0.0.0.0", allow_network=True)
    assert server.host == "0.0.0.0" and server.port > 0
    server.close()


# ---- attach: what is told when a client is behind


@pytest.fixture
def attached():
    """(server, client) with the client on can1, before any event."""
    server = AttachServer(fresh_name(), {"can1": lone_bus()}, 1_000)
    end, other = socket.socketpair()
    client = server._welcome(end)
    server.let_in(client)
    client.incoming += struct.pack("<IB4sHH4s", 13, 1, b"RNGR", 1, 0, b"can1")
    assert server._take(client) and not server._take(client)
    client.outgoing.clear()
    yield server, client
    server.close()
    other.close()


def reported(server, client, *events):
    client.tap.events += events
    server._report(client)
    found = bytes(client.outgoing)
    client.outgoing.clear()
    return found


def frame(kind, time, identifier, flags, lo, hi):
    """By ATTACH.md: length, type, then time, identifier, flags and both words."""
    return struct.pack("<IBqIHII", 23, kind, time, identifier, flags, lo, hi)


def test_attach_each_event_is_the_record_that_the_description_says(attached):
    server, client = attached
    client.outstanding = 5
    words = (0x123, 8, 0x04030201, 0x08070605)
    assert reported(server, client, (RECEIVED, 7, *words)) == frame(5, 1_007, *words)
    assert (server.totals["frames_out"], client.outstanding) == (1, 5)
    assert reported(server, client, (SENT, 8, *words)) == frame(6, 1_008, *words)
    assert reported(server, client, (DROPPED, 9, *words)) == frame(7, 1_009, *words)
    assert (server.totals["frames_out"], client.outstanding) == (1, 3)
    assert reported(server, client, (STATE, 10, 2, 70_000, 65_536, 0)) == struct.pack(
        "<IBqHHH", 15, 8, 1_010, 2, 65_535, 65_535
    )
    assert reported(server, client, (STATE, 10, 1, 65_534, 3, 0)) == struct.pack("<IBqHHH", 15, 8, 1_010, 1, 65_534, 3)
    assert reported(server, client) == b""


def test_attach_of_a_client_that_is_behind_frames_are_dropped_and_of_states_the_latest_is_kept(attached):
    server, client = attached
    client.outgoing += bytes(LIMITS["attach"].backlog)
    client.outstanding = 1
    words = (0x1, 0, 0, 0)
    shown = reported(
        server,
        client,
        (RECEIVED, 1, *words),
        (STATE, 2, 1, 128, 0, 0),
        (RECEIVED, 3, *words),
        (STATE, 4, 2, 256, 7, 0),
        (SENT, 5, *words),
    )
    assert shown[LIMITS["attach"].backlog :] == frame(6, 1_005, *words)  # that it asked for
    counted(server, clients=1, clients_seen=1, frames_dropped=2)
    state = struct.pack("<IBqHHH", 15, 8, 1_004, 2, 256, 7)
    overflow = struct.pack("<IBqQ", 17, 10, 1_006, 2)
    assert reported(server, client, (RECEIVED, 6, *words), (RECEIVED, 7, *words)) == state + overflow + frame(
        5, 1_006, *words
    ) + frame(5, 1_007, *words)
    counted(server, clients=1, clients_seen=1, frames_dropped=2, frames_out=2)


def test_attach_a_state_is_kept_while_the_buffer_is_full(attached):
    server, client = attached
    backlog = LIMITS["attach"].backlog
    client.outgoing += bytes(backlog)
    assert len(reported(server, client, (STATE, 2, 1, 128, 0, 0))) == backlog
    client.outgoing += bytes(backlog)
    assert len(reported(server, client)) == backlog
    client.outgoing += bytes(backlog - 1)
    assert reported(server, client)[backlog - 1 :] == struct.pack("<IBqHHH", 15, 8, 1_002, 1, 128, 0)
    assert reported(server, client) == b""


def test_attach_a_client_may_have_a_window_of_frames_without_an_answer(attached):
    server, client = attached
    send = struct.pack("<IBIHII", 15, 4, 0x123, 2, 0xBBAA, 0)
    client.incoming += send * TRANSMIT_QUEUE
    while server._take(client):
        pass
    assert (client.outstanding, len(client.tap.waiting)) == (TRANSMIT_QUEUE, TRANSMIT_QUEUE)
    assert client.tap.waiting[0] == (0x123, 2, 0xBBAA, 0)
    counted(server, clients=1, clients_seen=1, frames_in=TRANSMIT_QUEUE)
    client.incoming += send
    server._take(client)
    assert client.ending and b"window of 64" in bytes(client.outgoing)
    counted(server, clients_seen=1, frames_in=TRANSMIT_QUEUE, malformed=1, refused=1, sent_away_malformed=1)


def test_attach_what_a_client_sends_that_is_off_the_bus_is_answered_as_dropped(attached):
    server, client = attached
    client.tap.off = True
    client.incoming += struct.pack("<IBIHII", 15, 4, 0x123, 2, 0xBBAA, 0)
    assert server._take(client) and client.outstanding == 1
    assert client.tap.events == [(DROPPED, 0, 0x123, 2, 0xBBAA, 0)]
    counted(server, clients=1, clients_seen=1)
    assert reported(server, client) == frame(7, 1_000, 0x123, 2, 0xBBAA, 0) and client.outstanding == 0


@pytest.mark.parametrize(("wish", "silent", "queued"), [(1, False, 1), (2, True, 0), (3, False, 0)])
def test_attach_a_client_takes_part_listens_and_drops_what_waits(attached, wish, silent, queued):
    server, client = attached
    client.tap.offer(1, 0, 0, 0)
    client.incoming += struct.pack("<IBB", 2, 9, wish)
    assert server._take(client)
    assert (client.tap.silent, len(client.tap.waiting)) == (silent, queued)
    counted(server, clients=1, clients_seen=1)
    client.incoming += struct.pack("<IBB", 2, 9, 1)
    assert server._take(client) and not client.tap.silent


def test_attach_a_client_may_begin_by_listening():
    for options, silent in ((0, False), (1, True), (4, False), (5, True)):  # bit 2 means nothing yet
        server = AttachServer(fresh_name(), {"can1": lone_bus(), "can2": lone_bus("can2")}, 5)
        end, other = socket.socketpair()
        client = server._welcome(end)
        server.let_in(client)
        client.incoming += struct.pack("<IB4sHH4s", 13, 1, b"RNGR", 1, options, b"can2")
        assert server._take(client) and client.tap.silent == silent and client.taps is server.channels["can2"]
        assert client.tap.name == "can2 client 0"
        welcome = struct.pack("<IBHHIq", 26, 2, 1, 64, 1_000_000, 5) + b"can1\ncan2"
        assert bytes(client.outgoing) == welcome
        server.close()
        other.close()


# ---- what all have in common


def test_a_server_polls_sooner_while_frames_of_clients_wait(daemon):
    client = daemon.opened()
    assert daemon.server.poll(5 * MS) == 6 * MS
    client.tap.offer(1, 0, 0, 0)
    assert daemon.server.poll(6 * MS) == 6 * MS + MS // 4


@pytest.mark.parametrize(("waiting", "held"), [(1 << 16, False), ((1 << 16) + 1, True)])
def test_a_client_with_more_than_64_kb_waiting_holds_a_bus_at_full_speed(daemon, waiting, held):
    client = daemon.opened()
    client.stream.write = lambda _data: 0  # it takes nothing
    client.outgoing += bytes(waiting)
    daemon.server.poll(0)
    assert client.tap.held == held


def test_an_slcan_program_with_more_than_4_kb_waiting_holds_it():
    line = Line()
    line.say("O\r")
    line.program.stream.write = lambda _data: 0
    for waiting, held in ((4096, False), (4097, True)):
        line.program.outgoing[:] = bytes(waiting)
        line.server.poll(0)
        assert line.program.tap.held == held
    line.server.close()


def test_clients_that_others_poll_are_not_polled_by_a_server():
    """Given a bus it makes its clients' places itself and polls them; given the places, their owner does."""
    for owned in (True, False):
        bus = lone_bus()
        taps = Taps(bus)
        server = SocketcandServer({"can1": bus if owned else taps}, 0)
        mine = server.channels["can1"]
        assert (mine is taps) != owned
        mine.add("one").offer(1, 0, 0, 0)
        server.poll(1)
        assert bus.buffers.waiting_count == int(owned)
        server.close()


def test_a_server_is_patient_unless_requests_or_connections_wait(daemon):
    assert daemon.server.patience_s() == math.inf
    daemon.server.connections_wait = True
    assert daemon.server.patience_s() == 1.0 / 250  # so many connections a second
    daemon.server.left_over = True
    assert daemon.server.patience_s() == 0.0


def test_what_a_client_queued_is_dropped_when_it_is_sent_away_and_sent_when_it_leaves(daemon):
    staying, away, leaving = daemon.opened(), daemon.opened(), daemon.opened()
    taps = daemon.server.channels["can1"]
    places = [client.tap for client in (staying, away, leaving)]
    for tap in places:
        tap.offer(1, 0, 0, 0)
    places[2].held = True
    daemon.server.send_away(away, "malformed")
    assert away.tap is None and not places[1].waiting and places[1] not in taps.taps
    daemon.server.drop(leaving)
    assert leaving.tap is None and len(places[2].waiting) == 1 and not places[2].held
    assert places[2] in taps.taps and places[2].leaving
    counted(daemon.server, clients=1, clients_seen=3, frames_in=0, sent_away_malformed=1)


def test_at_the_end_clients_receive_what_the_last_poll_found(daemon):
    client = daemon.opened()
    client.tap.events.append((RECEIVED, 0, 0x1, 0, 0, 0))
    daemon.server.close()
    assert daemon.ends[0].recv(100) == b"< frame 001 0.000000  >"
