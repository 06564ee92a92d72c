"""Hostile programs at every endpoint: attach, slcan, socketcand and the supervisor's requests, on buses without a
robot.

One case is one action of one of them: it connects, leaves, sends valid or nearly valid messages of its protocol or
noise, once or thousands of times, in one packet or split, and reads its answers or never does. After every few cases
every endpoint is polled and checked: no poll and no peer's memory exceeds the table of limits, there are no more peers
than places, nothing invalid is admitted, and a well-behaved program at each is answered.
"""

from __future__ import annotations

import csv
import os
import pathlib
import socket
from collections.abc import Callable
from contextlib import closing, suppress
from typing import Any

from dev.fuzz import Finding
from ranger_sim import datatable
from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge import attach_records as wire
from ranger_sim.can_bus.edge.attach import AttachServer
from ranger_sim.can_bus.edge.peers import PeerServer
from ranger_sim.can_bus.edge.slcan import SlcanServer
from ranger_sim.can_bus.edge.socketcand import SocketcandServer
from ranger_sim.can_bus.edge.taps import TAP_LIMIT, Taps
from ranger_sim.foundation.events import STAGE_BUS, EventQueue
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.harness.processes.control import ControlServer, address
from ranger_sim.ranger.requests import Request, admitted

RATE = 1_000_000
POLL_NS = 500_000
CASES_PER_POLL = 4
HOSTILE = 6  # peers at each endpoint, except the one terminal
POLLS_TO_ANSWER = 400  # for a well-behaved program, independent of others: every poll serves it
POLLS_TO_REPEAT = 50
LONGEST_JSON = 70_000
NUMBERS = ("0", "5", "-1", "1.5", "1e20", "100000000000000000000", "1e999", "NaN", "-Infinity", "true", "null", "500")
TEXTS = (
    *('""', '"abc"', "[]", "{}", '{"do": "status"}', '"\\ud800"', "[[[[[]]]]]"),
    *('"MCH"', '"P_UI_LCD_TIME"', '"MCH.absolute_encoder:stuck"'),
)
VALUES = (*NUMBERS, *TEXTS)
NAMES = ("do", "key", "name", "value", "board", "fault", "which", "stick", "number", "", "\\u0000", "answer")
ORDERS = (
    *("status", "pause", "resume", "key", "set", "restart", "fault", "clear", "radio"),
    *("stop", "make_room", "revive", "finish", ""),
)
FIELDS = {
    "key": {"key"},
    "set": {"name", "value"},
    "restart": {"board"},
    "fault": {"fault"},
    "clear": {"which"},
    "radio": {"stick"},
}
WORDS = (
    "open",
    "rawmode",
    "echo",
    "send",
    "can1",
    "can9",
    "bcmmode",
    "<",
    "123",
    "7ff",
    "1fffffff",
    "8",
    "0",
    "-1",
    "x",
)
SLCAN = ("V", "v", "N", "F", "O", "L", "C", "Z0", "Z1", "S6", "t1230", "t12380011223344556677", "T1FFFFFFF0", "r7FF8")
# Mostly the first message of a hostile program: a client on a bus can do more harm.
GREETINGS = {
    "attach": wire.record(wire.HELLO, wire.HELLO_BODY.pack(wire.MAGIC, wire.VERSION, 0) + b"can1"),
    "slcan": b"\rO\r",
    "socketcand": b"< open can1 >< rawmode >",
    "control": b"",
}


class Program:
    """One end of one connection, hostile or well-behaved. Without a connection (`number` -1) it tries again."""

    def __init__(self, connect: Callable[[], int], greeting: bytes = b"") -> None:
        self.connect = connect
        self.greeting = greeting
        self.number = -1
        self.reads = True
        self.heard = bytearray()
        self.again()

    def say(self, data: bytes) -> None:
        """Send as much as possible; where the endpoint has closed the connection, over a new one next time."""
        if self.number < 0:
            self.again()
        try:
            if self.number >= 0:
                os.write(self.number, data)
        except BlockingIOError:
            pass
        except OSError:
            self.again()

    def hear(self) -> bytes:
        """What has come."""
        try:
            while self.number >= 0:
                data = os.read(self.number, 1 << 16)
                self.heard += data
                if not data:
                    self.again()
        except BlockingIOError:
            pass
        except OSError:
            self.again()
        return bytes(self.heard)

    def again(self) -> None:
        """Open a new connection, if the endpoint's queue has a place."""
        self.close()
        self.heard.clear()
        self.reads = True
        with suppress(OSError):
            self.number = self.connect()
            os.write(self.number, self.greeting)

    def close(self) -> None:
        if self.number >= 0:
            os.close(self.number)
        self.number = -1


class Fuzz:
    """`case()` is one case, `poll()` polls and checks; Finding as soon as a check fails."""

    def __init__(self, seed: int = 1) -> None:
        self.stream: Any = RandomStream(seed, "doors fuzz")  # a name kept for the recorded seeds
        self.now_ns = 0
        self.cases = self.polls = self.admitted = 0
        self.limits = parameter_limits()
        self.bus = Bus("can1", RATE, log_capacity=0)
        self.inbox = EventQueue(64)
        self.bus.add_node("board", self.inbox, 1, STAGE_BUS * 256)
        self.taps = Taps(self.bus)
        name = f"fuzz-interfaces-{os.getpid()}-{id(self)}"
        buses = {"can1": self.taps}
        self.attach = AttachServer(name, buses)
        self.terminal = SlcanServer("can1", self.taps)
        self.tcp = SocketcandServer(buses, 0)
        self.control = ControlServer(name, admitted, self.obey)
        self.servers: tuple[PeerServer[Any], ...] = (self.attach, self.terminal, self.tcp, self.control)
        for server in self.servers:
            server.clock = lambda: self.now_ns * 1e-9
        ways = {
            "attach": lambda: local(wire.SOCKET_PREFIX + name),
            "slcan": lambda: os.open(self.terminal.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK),
            "socketcand": lambda: distant(self.tcp.port),
            "control": lambda: local(address(name)),
        }
        self.hostile = {
            kind: [Program(way, GREETINGS[kind]) for _ in range(1 if kind == "slcan" else HOSTILE)]
            for kind, way in ways.items()
        }
        self.kinds = tuple(ways)
        self.questions = {"attach": HELLO, "socketcand": b"< echo >", "control": b'{"do": "status"}\n'}
        self.good = {kind: Program(ways[kind]) for kind in self.questions}
        self.asked = dict.fromkeys(self.questions, -1)  # at which poll; -1: answered
        self.answered = 0

    # ---- messages of hostile programs

    def number(self, n: int) -> int:
        """Uniform in 0 ... n-1."""
        return int(self.stream.integer(n))

    def one_of(self, choices: tuple[Any, ...]) -> Any:
        return choices[self.number(len(choices))]

    def noise(self) -> bytes:
        return bytes(self.number(256) for _ in range(self.number(64)))

    def of_attach(self) -> bytes:
        """A record: of its kind, of any kind, or with a wrong length."""
        kind = self.number(24)
        if kind == 0:
            channel = self.one_of((b"can1", b"", b"can9", b"\xff", b"can1\ncan1", b"x" * 900))
            body = wire.HELLO_BODY.pack(self.one_of((wire.MAGIC, b"HTTP")), self.number(3), self.number(4))
            return wire.record(wire.HELLO, body + channel)
        if kind == 1:
            return wire.record(self.number(256), self.noise())
        if kind == 2:
            length = self.one_of((0, 1, 1024, 1025, 1 << 31, (1 << 32) - 1))
            return wire.HEAD.pack(length, self.number(12)) + self.noise()
        if kind == 3:
            return wire.send_record(self.number(1 << 32), self.number(1 << 16), self.number(1 << 32), 0)
        if kind < 10:
            return wire.record(wire.CONTROL, bytes([1 + self.number(3)]))
        return wire.send_record(self.number(0x800), self.number(9), self.number(1 << 32), self.number(1 << 32))

    def of_slcan(self) -> bytes:
        """A command, whole, with another end, or without one."""
        return str(self.one_of(SLCAN)).encode() + self.one_of((b"\r", b"\r", b"\r", b"\n", b"", b"0" * 40 + b"\r"))

    def of_socketcand(self) -> bytes:
        """Words in brackets, or almost."""
        words = " ".join(self.one_of(WORDS) for _ in range(self.number(12)))
        send = f"< send {self.number(0x900):x} 2 1 {self.number(257):x} >"
        most = (send, send, send, "< echo >", f"< {words} >")
        odd = ("< open can1 >< rawmode >", f"<{words}>", f"< {words}", " " * 300, f"{words} >")
        return str(self.one_of(most if self.number(4) else odd)).encode()

    def of_control(self) -> bytes:
        """A request: of the model, of other words and values, nested, doubled, or long."""
        kind = self.number(8)
        if kind == 0:
            return self.one_of((b"[", b'{"do":', b"[{", b"9")) * self.number(LONGEST_JSON // 6) + b"\n"
        order = self.one_of(ORDERS)
        if kind < 4:
            fields = FIELDS.get(order, set())
            names = {**dict.fromkeys(fields), "do": None}
        else:
            names = dict.fromkeys(self.one_of(NAMES) for _ in range(self.number(5)))
        values = {name: self.one_of(VALUES) for name in names}
        if "do" in values and kind != 7:
            values["do"] = f'"{order}"'
        if "name" in values and self.number(2):
            values["name"] = f'"{self.one_of(tuple(self.limits))}"'
        if "value" in values and self.number(2):
            values["value"] = repr((self.number(1 << 20) - (1 << 19)) / (1 + self.number(1 << 12)))
        text = ", ".join(f'"{name}": {value}' for name, value in values.items())
        return f"{{{text}}}\n".encode()

    def case(self) -> None:
        """One action of one program."""
        kind = self.one_of(self.kinds)
        program = self.one_of(tuple(self.hostile[kind]))
        self.cases += 1
        what = self.number(40)
        if what == 0:
            program.again()
        elif what == 1:
            program.reads = not program.reads
        elif what == 2 and kind != "slcan":
            half_closed(program.number)
        elif what == 3:
            program.say(self.noise())
        else:
            data = getattr(self, f"of_{kind}")()
            if what == 4:
                data = data[: self.number(len(data) + 1)]
            elif what == 5:
                data *= 1 + self.number(20_000 // max(1, len(data)))
            elif what < 12:
                data += getattr(self, f"of_{kind}")()
            program.say(data)

    # ---- checks of the endpoints

    def obey(self, number: int, request: Request) -> None:
        """Check that an admitted request fits the model, with code independent of the endpoint."""
        self.admitted += 1
        fine = {
            "status": True,
            "pause": True,
            "resume": True,
            "key": type(request.key) is int and request.key in range(6),
            "restart": request.board in ("MCH", "MCFO", "MCFI", "MCSI", "UI", "CSR", "MB"),
            "fault": request.fault == "MCH.absolute_encoder:stuck",  # the only text of a fault among the values
            "clear": type(request.which) is int and 0 <= request.which <= 255,
            "radio": type(request.stick) is float and -1.0 <= request.stick <= 1.0,
            "set": request.name in self.limits
            and type(request.value) is float
            and self.limits[request.name][0] <= request.value <= self.limits[request.name][1],
        }
        if fine.get(request.do) is not True:
            raise Finding(f"{request} was admitted (case {self.cases})")
        self.control.answer(number, {"did": request.do})

    def poll(self) -> None:
        """Advance a little time, and poll every endpoint."""
        self.now_ns += POLL_NS
        self.polls += 1
        before = [server.worked for server in self.servers]
        for bus_server in (self.attach, self.terminal, self.tcp):
            bus_server.poll(self.now_ns)
        self.control.poll()
        self.bus.advance(self.now_ns)
        self.taps.poll(self.now_ns)
        self.inbox.clear()
        for server, worked in zip(self.servers, before, strict=True):
            self.check(server, server.worked - worked)
        self.talk()
        for programs in self.hostile.values():
            for program in programs:
                if program.reads:
                    program.hear()
                    program.heard.clear()

    def check(self, server: PeerServer[Any], worked: int) -> None:
        """Raise Finding when an endpoint has done or holds more than the table allows."""
        limits = server.limits
        answer = 4 * 1024  # the longest single answer of any endpoint is below that
        most_out = limits.backlog + limits.unread + limits.burst * answer
        for what, is_so in (
            (f"{worked} requests in a poll", worked <= limits.burst),
            (f"{len(server.peers)} peers", len(server.peers) <= limits.peers),
            (
                "a peer's input piles up",
                self.most(server, "incoming") <= limits.longest + limits.read_bytes,
            ),
            ("a peer's answers pile up", self.most(server, "outgoing") <= most_out),
            (f"{len(self.taps.taps)} clients on a bus", len(self.taps.taps) <= TAP_LIMIT),
        ):
            if not is_so:
                raise Finding(f"{server.kind}: {what} (case {self.cases})")

    @staticmethod
    def most(server: PeerServer[Any], buffer: str) -> int:
        return max((len(getattr(peer, buffer)) for peer in server.peers), default=0)

    def talk(self) -> None:
        """Well-behaved programs send requests, are answered in time, and repeat. A disconnected one must have a
        reason."""
        for kind, program in self.good.items():
            heard = program.hear()
            if self.asked[kind] < 0:
                program.heard.clear()
                program.say(self.questions[kind])
                self.asked[kind] = self.polls
            elif answered(kind, heard):
                self.asked[kind] = -1
                self.answered += 1
            elif self.polls - self.asked[kind] > POLLS_TO_ANSWER:
                raise Finding(f"{kind}: a well-behaved program is not answered (case {self.cases}): {heard[:80]!r}")
            elif (self.polls - self.asked[kind]) % POLLS_TO_REPEAT == 0:
                program.say(self.questions[kind])  # it may have lost its place and the request

    def counted(self) -> dict[str, int]:
        """Counts by name."""
        found = {
            "cases": self.cases,
            "polls": self.polls,
            "answered": self.answered,
            "admitted": self.admitted,
            "not_admitted": self.control.not_admitted,
            "frames": self.bus.counters.frames,
        }
        for server in self.servers:
            found[f"{server.kind}_requests"] = server.worked
            for reason, count in server.sent_away.items():
                found[f"{server.kind}_{reason}"] = count
        return found

    def close(self) -> None:
        """Everything."""
        for programs in (*self.hostile.values(), list(self.good.values())):
            for program in programs:
                program.close()
        for server in self.servers:
            server.close()


HELLO = wire.record(wire.HELLO, wire.HELLO_BODY.pack(wire.MAGIC, wire.VERSION, 0))  # for the channels alone


def answered(kind: str, heard: bytes) -> bool:
    """True when this is the answer to the request."""
    if kind == "attach":
        return heard.endswith(b"can1") and heard[4:5] == bytes([wire.WELCOME])
    return heard.endswith(b"< echo >" if kind == "socketcand" else b'{"did": "status"}\n')


def parameter_limits() -> dict[str, tuple[float, float]]:
    """{parameter: least, most} from the master file."""
    text = (pathlib.Path(datatable.__file__).parent / "master" / "variables.csv").read_text(encoding="utf-8")
    largest = 3.4028234663852886e38  # of single precision
    return {
        row["name"]: (float(row["minimum"] or -largest), float(row["maximum"] or largest))
        for row in csv.DictReader(text.splitlines())
        if row["publisher"] == "PC" and not row["name"].startswith("LV_")
    }


def local(where: str) -> int:
    """A connection to a local server, as a descriptor."""
    client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    client.setblocking(False)  # a full queue is reported at once
    try:
        client.connect(where)
    except OSError:
        client.close()
        raise
    return client.detach()


def distant(port: int) -> int:
    """A connection over loopback, as a descriptor; it may need several attempts."""
    client = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    client.setblocking(False)
    with suppress(BlockingIOError):  # it is being established
        client.connect(("127.0.0.1", port))
    return client.detach()


def half_closed(number: int) -> None:
    """Shut down sending; answers can still be received."""
    if number < 0:
        return
    client = socket.socket(fileno=os.dup(number))
    with client, suppress(OSError):
        client.shutdown(socket.SHUT_WR)


def run(cases: int, seed: int = 1) -> dict[str, int]:
    """Run `cases` cases; returns the counts of the endpoints. Any other exception is a finding too, located by its
    traceback."""
    fuzz = Fuzz(seed)
    with closing(fuzz):
        try:
            while fuzz.cases < cases:
                for _ in range(min(CASES_PER_POLL, cases - fuzz.cases)):
                    fuzz.case()
                fuzz.poll()
        except Exception as error:
            if not isinstance(error, Finding):
                error.add_note(f"python -m dev.fuzz interfaces: seed {seed}, case {fuzz.cases}")
            raise
        return fuzz.counted()
