"""Hostile programs at the panel's endpoints, HTTP and WebSocket, with a robot that has walked a little.

One case is one action of one of them: it requests a file, a selection or a page, with or without the token; sends valid
or nearly valid messages or noise, whole, cut or in pieces; stops reading, or leaves. After each the server does its
work, and 5 ms pass on its clock, which is not a wall clock. No request may end in an exception, pages and connections
must not exceed their places, output that waits for a page is bounded, pages receive only messages of the protocol, and
a well-behaved page is always answered.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import os
import socket
import struct
import threading
from collections.abc import Iterator
from typing import Any

import h11
import uvicorn
from uvicorn.server import ServerState

from dev.fuzz import Connection, Finding
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.harness.feed import records
from ranger_sim.ranger.feed import FeedServer
from ranger_sim.ranger.requests import admitted
from ranger_sim.ranger.robot import Ranger
from ranger_sim.tools.panel.command import http_server
from ranger_sim.tools.panel.connections import MOST
from ranger_sim.tools.panel.robot import RobotSource
from ranger_sim.tools.panel.server import COOKIE, PLACES, PanelServer

WALKED_S = 0.4
CASE_S = 0.005
HOSTILE = 12  # programs
ABANDONED = 100  # connections that they have left open and never use again
TURNS = 6  # of the server's loop after a case: enough to receive, execute and answer a message
TURNS_TO_ANSWER = 4000
CASES_TO_CHECK = 20
CASES_TO_VISIT = 500
THREADS_S = 0.001  # between two checks for data that a thread of the server reads from a file
LONGEST = 4 << 20  # bytes of a message to a page: 48 channels of 4000 points have below 3 MB
TOKEN = "the-right-word"
CLOSE, PING, PONG, TEXT, BINARY, MORE = 8, 9, 10, 1, 2, 0
CODES = {*range(1000, 1016)} - {1004, 1005, 1006, 1015}  # that may be sent (RFC 6455, 7.4.1); a page's own are returned
VALUES = (
    *("0", "1", "-1", "0.1", "5", "47", "4000", "4001", "1e9", "-1e9", "1e999", "NaN", "100000000000000000000", "true"),
    *("null", '""', '"MCH_ANGLE"', '"P_UI_LCD_TIME"', "[]", "{}", "[0]", "[0, 1, 2, 47]", "[-1]", "[1e3]", "[[0]]"),
    *('"\\ud800"', '"MCH.absolute_encoder:stuck"', "[" * 40 + "]" * 40, "9" * 5000),
)
WISHES = ("shown", "look", "values", "key", "set", "pause", "resume", "restart", "fault", "clear", "radio", "", "hello")
NAMES = (
    "plots",
    "channels",
    "begin",
    "end",
    "span",
    "points",
    "at",
    "number",
    "key",
    "name",
    "value",
    "hidden",
    "which",
)
PATHS = (
    "/",
    "/panel.js",
    "/panel.css",
    "/nothing",
    "/../server.py",
    "/export/csv",
    "/export/exe",
    "/socket",
    "/%00",
    "//",
    "*",
)
METHODS = ("GET", "GET", "GET", "GET", "POST", "HEAD", "OPTIONS", "PUT", "\x00")


class Looked(RobotSource):
    """A robot whose requests are only checked by the supervisor's model."""

    async def request(self, wish: dict[str, Any]) -> dict[str, Any]:
        return {"did": admitted(json.dumps(wish).encode()).do}


def walked() -> Looked:
    """Data of a panel that has shown a robot for WALKED_S."""
    name = f"fuzz-panel-{os.getpid()}"
    found: list[Looked] = []
    with contextlib.closing(Ranger()) as robot:
        feed = FeedServer(robot, name)
        robot.attach(feed)
        thread = threading.Thread(target=lambda: found.append(Looked(name)))
        thread.start()
        while thread.is_alive():
            feed.poll(robot.loop.time)
        source = found[0]
        source.connection.setblocking(False)
        while robot.time_s < WALKED_S:
            robot.run_for(0.02)
            feed.poll(robot.loop.time)
            with contextlib.suppress(BlockingIOError):
                while data := source.connection.recv(1 << 20):
                    source.incoming += data
            for kind, body in records.taken(source.incoming):
                source._take(kind, body)
        source.connection.close()
        feed.close()
    return source


class Faults(logging.Handler):
    """Exceptions of the panel; the server's own messages about broken HTTP or UTF-8 are not faults."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.found: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        trouble = record.exc_info[1] if record.exc_info else None
        if isinstance(trouble, h11.LocalProtocolError | UnicodeDecodeError):
            return
        self.found.append(f"{record.getMessage().strip()}: {trouble!r}")


class Program(Connection):
    """A connection of one program. is_page: it has begun a WebSocket."""

    def __init__(self, port: int) -> None:
        super().__init__(socket.create_connection(("127.0.0.1", port)))
        self.is_page = True


def handshake(port: int, token: str = TOKEN) -> bytes:
    """First message of a page (RFC 6455, 4.1)."""
    return (
        f"GET /socket?token={token} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    ).encode()


def frame(data: bytes, code: int = TEXT, last: bool = True) -> bytes:
    """A frame of a client, masked with zeros (RFC 6455, 5.2)."""
    head = bytes([code | 0x80 * last])
    if len(data) < 126:
        return head + bytes([0x80 | len(data)]) + bytes(4) + data
    if len(data) < 1 << 16:
        return head + b"\xfe" + struct.pack(">H", len(data)) + bytes(4) + data
    return head + b"\xff" + struct.pack(">Q", len(data)) + bytes(4) + data


def frames_of(heard: bytearray) -> Iterator[tuple[int, bytes]]:
    """(code, content) of every whole frame at the head of a page's received bytes, removing them."""
    while len(heard) >= 2:
        code, length, at = heard[0], heard[1], 2
        if code & 0x70 or code & 15 not in (TEXT, BINARY, CLOSE, PING, PONG) or length & 0x80:
            raise ValueError(f"no frame of a server: {bytes(heard[:20])!r}")
        if length >= 126:
            size = 2 if length == 126 else 8
            if len(heard) < 2 + size:
                return
            length, at = int.from_bytes(heard[2 : 2 + size], "big"), 2 + size
        if length > LONGEST:
            raise ValueError(f"a message of {length} bytes")
        if len(heard) < at + length:
            return
        content = bytes(heard[at : at + length])
        del heard[: at + length]
        yield code & 15, content


def understood(code: int, content: bytes) -> dict[str, Any]:
    """Message in a frame of the panel; ValueError where it is not one of `tools/panel/messages.py`."""
    if code == CLOSE:
        number = int.from_bytes(content[:2], "big")
        if number not in CODES:
            raise ValueError(f"closed with code {number}")
        return {"closed": number}
    if code in (PING, PONG):
        return {}
    if code != BINARY or len(content) < 16:
        raise ValueError(f"a message of code {code} and {len(content)} bytes")
    version, kind, _, channels, _, points, _ = struct.unpack_from("<BBHHHII", content)
    if version != 3:
        raise ValueError(f"version {version}")
    if kind == 1:
        if points != len(content) - 16:
            raise ValueError(f"a text of {len(content) - 16} bytes says {points}")
        found: dict[str, Any] = json.loads(content[16:], parse_constant=_no_number)
        return found
    if kind == 2:
        at = 32
        for _ in range(channels):
            _, flags, count, _ = struct.unpack_from("<IIII", content, at)
            body = 4 * count * (2 if flags & 1 else 1)
            at += 16 + 8 * count + body + -body % 8
        if at != len(content):
            raise ValueError(f"traces of {len(content)} bytes say {at}")
        return {}
    if kind == 3 and 16 + 8 + 4 * points == len(content):
        return {}
    if kind == 4:
        return _picture(content, points)
    raise ValueError(f"kind {kind} with {len(content)} bytes")


def _picture(content: bytes, count: int) -> dict[str, Any]:
    found: dict[str, Any] = {}
    at = 16
    for _ in range(count):
        length, _ = struct.unpack_from("<II", content, at)
        found |= understood(BINARY, content[at + 8 : at + 8 + length])
        at += 8 + length + -length % 8
    if at != len(content):
        raise ValueError(f"a picture of {len(content)} bytes says {at}")
    return found


def _no_number(text: str) -> None:
    raise ValueError(f"{text} in a text")


class Fuzz:
    """`case()` is one case; Finding as soon as a check fails."""

    def __init__(self, seed: int, source: Looked) -> None:
        self.stream: Any = RandomStream(seed, "panel fuzz")
        self.source = source
        self.cases = self.answered = self.visits = self.messages = self.sent_away = 0
        self.reported: list[str] = []
        self.faults = Faults()
        self.now_s = 0.0

    async def begin(self) -> None:
        """The server, on a clock of ours."""
        loop = asyncio.get_running_loop()
        loop.time = lambda: self.now_s  # type: ignore[method-assign]
        self.panel = PanelServer(self.source, TOKEN, ("127.0.0.1",), self.reported.append)
        config: uvicorn.Config = http_server(self.panel).config
        config.load()
        log = logging.getLogger("uvicorn.error")
        log.setLevel(logging.ERROR)
        log.addHandler(self.faults)
        log.propagate = False
        loop.set_exception_handler(lambda _, context: self.faults.found.append(str(context)))
        state = ServerState()
        make: Any = self.panel.connections.protocol
        self.server = await loop.create_server(
            lambda: make(config=config, server_state=state, app_state={}), "127.0.0.1", 0
        )
        self.port = self.server.sockets[0].getsockname()[1]
        self.hostile = [Program(self.port) for _ in range(HOSTILE)]
        self.abandoned: list[Program] = []
        self.good = Program(self.port)
        self.good.say(handshake(self.port))
        await self.until(self.good, b"\r\n\r\n")
        del self.good.heard[: self.good.heard.index(b"\r\n\r\n") + 4]

    # ---- messages of hostile programs

    def number(self, n: int) -> int:
        """Uniform in 0 ... n-1."""
        return int(self.stream.integer(n))

    def one_of(self, choices: Any) -> Any:
        return choices[self.number(len(choices))]

    def noise(self) -> bytes:
        return bytes(self.number(256) for _ in range(self.number(64)))

    def value(self) -> str:
        """A value in JSON, or almost."""
        return str(self.one_of(VALUES))

    def plot(self) -> str:
        """A plot as requested by a page, some of its fields extreme."""
        first = self.number(430)
        fields = {
            "channels": str([first + each for each in range(self.number(4))]),
            "points": str(1 + self.number(800)),
            "span": str(self.number(100) / 100),
        }
        if self.number(2):
            fields |= {"begin": str(self.number(100) / 200 - 0.1), "end": str(self.number(100) / 100)}
        if self.number(4) == 0:
            fields[self.one_of(NAMES)] = self.value()
        return "{" + ", ".join(f'"{name}": {value}' for name, value in fields.items()) + "}"

    def wish(self) -> bytes:
        """A request of a page, or almost."""
        kind = self.number(8)
        if kind == 0:
            return self.value().encode()
        do = self.one_of(WISHES)
        fields = {"do": f'"{do}"'}
        if do == "look":
            fields["plots"] = "[" + ", ".join(self.plot() for _ in range(self.number(4))) + "]"
            fields["at"] = self.one_of(("null", "0.1", "0.3", "5"))
        if do == "values":
            fields |= {"channels": str([self.number(440) for _ in range(self.number(5))]), "at": "0.2"}
        if self.number(3):
            fields["number"] = str(self.number(100))
        for _ in range(self.number(3) if kind < 4 else 0):
            fields[self.one_of((*NAMES, "do"))] = self.value()
        return ("{" + ", ".join(f'"{name}": {value}' for name, value in fields.items()) + "}").encode()

    def of_page(self) -> bytes:
        """Frames of a page."""
        kind = self.number(16)
        data = self.wish()
        if kind == 0:
            return frame(data, BINARY)
        if kind == 1:
            return frame(data[:100], self.one_of((CLOSE, PING, PONG, 3, 11)))
        if kind == 2:
            half = len(data) // 2
            return frame(data[:half], TEXT, False) + frame(data[half:], MORE, bool(self.number(4)))
        if kind == 3:
            return bytes([self.number(256), self.number(256)]) + self.noise()
        if kind == 4:
            return frame(struct.pack(">H", 1000 + self.number(20)), CLOSE)
        if kind == 5:
            return frame(data * self.number(200))
        return frame(data)

    def of_http(self) -> bytes:
        """A request: a path, a token, heads, some of them another's."""
        path = self.one_of(PATHS)
        token = self.one_of((TOKEN, TOKEN, TOKEN, "", "guess", "\xff", "%FF", TOKEN + "x"))
        query = f"token={token}"
        if "export" in path:
            window = f"&begin={self.one_of((0, 0.1, 'x', '', -1e9))}&end={self.one_of((0.2, 0.4, 1e300, 'nan'))}"
            query += f"&channels={self.number(440)},{self.one_of((1, 2, '', 'x', 10**30))}{window}"
        heads = [f"Host: {self.one_of((f'127.0.0.1:{self.port}',) * 6 + ('elsewhere:80', '', '[::1]:80', 'x'))}"]
        if self.number(5) == 0:
            heads.append(f"Origin: {self.one_of((f'http://127.0.0.1:{self.port}', 'http://x', 'null', '://[', ''))}")
        if self.number(5) == 0:
            heads.append(f"Cookie: {COOKIE}={self.one_of((TOKEN, 'guess', ''))}")
        if self.number(10) == 0:
            heads.append(self.one_of(("Content-Length: 5", "Transfer-Encoding: chunked", "Expect: 100-continue", "X")))
        if path == "/socket" or self.number(10) == 0:
            key = self.one_of(("AAAAAAAAAAAAAAAAAAAAAA==", "x", ""))
            heads += ["Upgrade: websocket", "Connection: Upgrade", f"Sec-WebSocket-Key: {key}"]
            heads.append(f"Sec-WebSocket-Version: {self.one_of((13, 13, 8))}")
        text = f"{self.one_of(METHODS)} {path}?{query} HTTP/1.{self.one_of((1, 1, 1, 0, 7))}\r\n"
        return (text + "\r\n".join(heads) + "\r\n\r\n").encode("latin-1")

    async def case(self) -> None:
        """One action of one program, then the server's work."""
        self.cases += 1
        place = self.number(HOSTILE)
        program = self.hostile[place]
        what = self.number(40)
        if program.gone or what == 0:
            if program.gone or self.number(2):
                program.close()
            elif len(self.abandoned) < ABANDONED:
                self.abandoned.append(program)
            else:
                oldest, self.abandoned[self.cases % ABANDONED] = self.abandoned[self.cases % ABANDONED], program
                oldest.close()
            program = self.hostile[place] = Program(self.port)
            program.is_page = bool(self.number(4))
            if program.is_page:
                program.say(handshake(self.port, self.one_of((TOKEN,) * 7 + ("guess",))))
        elif what == 1:
            program.reads = not program.reads
        elif what == 2:
            with contextlib.suppress(OSError):
                program.socket.shutdown(socket.SHUT_WR)
        elif what == 3:
            program.say(self.noise())
        else:
            say = self.of_page if program.is_page else self.of_http
            data = say()
            if what == 4:
                data = data[: self.number(len(data) + 1)]
            elif what < 8:
                data += say() + say()
            elif what == 8:
                data *= 1 + self.number(4000 // (len(data) + 1))
            program.say(data)
        self.now_s += CASE_S
        for _ in range(TURNS):
            await asyncio.sleep(0)
        if program.reads:
            program.hear()
            self.understand(program)
        if self.cases % CASES_TO_CHECK == 0:
            await self.check()
        if self.cases % CASES_TO_VISIT == 0:
            await self.visit()

    # ---- checks of the server

    def fault(self, text: str) -> Finding:
        return Finding(f"{text} (case {self.cases})")

    def understand(self, program: Program) -> list[dict[str, Any]]:
        """Take received messages from a page. From any other connection, take everything."""
        if not program.is_page:
            program.heard.clear()
            return []
        if program.heard.startswith(b"HTTP/1.1 101") and b"\r\n\r\n" in program.heard:
            del program.heard[: program.heard.index(b"\r\n\r\n") + 4]
        if program.heard.startswith(b"HTTP"):  # an answer to something other than a request for a page
            program.heard.clear()
            return []
        try:
            frames = list(frames_of(program.heard))
            found = [understood(*each) for each in frames]
        except (ValueError, struct.error) as trouble:
            raise self.fault(f"a page is sent what it does not understand: {trouble}") from trouble
        for code, content in frames:
            if code == PING:
                program.say(frame(content, PONG))
        self.messages += len(found)
        self.sent_away += sum("closed" in each for each in found)
        return found

    async def check(self) -> None:
        """Check that nothing exceeds its limit, nothing has failed, and the well-behaved page is answered."""
        if self.faults.found:
            raise self.fault(f"the server met {self.faults.found[0][:300]}")
        panel = self.panel
        if len(panel.sessions) > PLACES or len(panel.connections.transports) > MOST:
            raise self.fault(f"{len(panel.sessions)} pages, {len(panel.connections.transports)} connections")
        most = max((each.get_write_buffer_size() for each in panel.connections.transports.values()), default=0)
        if most > 2 * LONGEST:
            raise self.fault(f"{most} bytes wait for a page")
        self.good.say(frame(json.dumps({"do": "values", "channels": [0], "at": 0.2, "number": self.cases}).encode()))
        for _ in range(TURNS_TO_ANSWER):
            self.good.hear()
            found = self.understand(self.good)
            if any("picture" in each for each in found):
                self.good.say(frame(b'{"do": "shown"}'))
            if any(each.get("answer") == self.cases and each["values"] for each in found):
                self.answered += 1
                return
            self.now_s += CASE_S / TURNS
            await asyncio.sleep(0)
        raise self.fault("a well-behaved page is not answered")

    async def visit(self) -> None:
        """A client loads the page."""
        visitor = Program(self.port)
        with contextlib.closing(visitor):
            visitor.say(f"GET /?token={TOKEN} HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\n\r\n".encode())
            await self.until(visitor, b"</html>")
            if not visitor.heard.startswith(b"HTTP/1.1 200 "):
                raise self.fault(f"a client that loads the page receives {bytes(visitor.heard[:60])!r}")
        self.visits += 1

    async def until(self, program: Program, end: bytes) -> None:
        """Run the server until a program has received that."""
        for turn in range(TURNS_TO_ANSWER):
            await asyncio.sleep(0)
            program.hear()
            if end in program.heard:
                return
            if turn > TURNS:
                wallclock.sleep_s(THREADS_S)
        raise self.fault(f"a well-behaved program waits for {end!r}, and received {bytes(program.heard[:60])!r}")

    def counted(self) -> dict[str, int]:
        """Counts by name."""
        found = {"cases": self.cases, "messages": self.messages, "well_behaved_answered": self.answered}
        found |= {"pages_loaded": self.visits, "closed_with_a_reason": self.sent_away}
        return found | {f"refused_{reason.replace(' ', '_')}": count for reason, count in self.panel.refused.items()}

    async def end(self) -> None:
        """Release everything."""
        for program in (*self.hostile, *self.abandoned, self.good):
            program.close()
        for transport in self.panel.connections.transports.values():
            transport.abort()
        for _ in range(10 * TURNS):
            await asyncio.sleep(0)
        self.server.close()
        logging.getLogger("uvicorn.error").removeHandler(self.faults)


async def _run(cases: int, seed: int, source: Looked) -> dict[str, int]:
    fuzz = Fuzz(seed, source)
    await fuzz.begin()
    try:
        for _ in range(cases):
            await fuzz.case()
        await fuzz.check()
        return fuzz.counted()
    finally:
        await fuzz.end()


def run(cases: int, seed: int = 1) -> dict[str, int]:
    """Run `cases` cases; returns the counts."""
    return asyncio.run(_run(cases, seed, walked()))
