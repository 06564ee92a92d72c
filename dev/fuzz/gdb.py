"""Hostile debuggers at a board's gdb port: valid and nearly valid requests and noise, with a small processor.

After every case: the port sends frames with correct checksums, its answers are bounded, and now and then a well-behaved
debugger connects, reads all registers and disconnects; the processor continues afterwards.
"""

from __future__ import annotations

import contextlib
import socket
from typing import Any

from dev.fuzz import Finding
from ranger_sim.firmware_sim.arm7.core import Core
from ranger_sim.firmware_sim.gdb.packets import framed
from ranger_sim.firmware_sim.gdb.server import GdbServer
from ranger_sim.foundation.random_stream import RandomStream

# add r0, r0, #1; str r0, [r1]; b to the first: it counts in RAM
PROGRAM = (0xE3A01101, 0xE2800001, 0xE5810000, 0xEAFFFFFC)
CYCLES = 40  # run time of the processor in a case, while no debugger halts it
CASES_TO_CHECK = 40
LOOKS = 400
# Requests of the remote serial protocol (gdb 13, appendix E); {a}: an address, {n}: a number, {h}: bytes in base 16.
REQUESTS = (
    *("?", "g", "G{h}", "p{n}", "P{n}={h}", "m{a},{n}", "M{a},{n}:{h}", "X{a},{n}:{h}", "c", "c{a}", "s", "s{a}"),
    *("Z0,{a},{n}", "z0,{a},{n}", "Z1,{a},{n}", "z1,{a},{n}", "Z2,{a},{n}", "Z3,{a},{n}", "Z4,{a},{n}", "z4,{a},{n}"),
    *(
        "vCont?",
        "vCont;c",
        "vCont;s:{n}",
        "vCont;{h}",
        "Hg{n}",
        "Hc-1",
        "D",
        "k",
        "R{n}",
        "!",
        "T{n}",
        "qC",
        "qAttached",
    ),
    *("qSupported:{h}", "qfThreadInfo", "qsThreadInfo", "qOffsets", "qRcmd,{h}", "qCRC:{a},{n}", "QStartNoAckMode"),
    *("qXfer:features:read:target.xml:{n},{n}", "qXfer:memory-map:read::{n},{n}", "vFlashErase:{a},{n}"),
    *("vFlashWrite:{a}:{h}", "vFlashDone", "vMustReplyEmpty", "qXfer:{h}", "{h}", ""),
)
PLACES = (0, 4, 8, 0x3FFF0, 0x40000, 0x40000000, 0x40003FFC, 0x40004000, 0xE0000000, 0xFFFFF000, 0xFFFFFFFF)


class Board:
    """The target behind the port."""

    name = "FUZZ"

    def __init__(self) -> None:
        self.core = Core(name=self.name)
        for place, word in enumerate(PROGRAM):
            self.core.place(4 * place, word.to_bytes(4, "little"))


class Fuzz:
    """`case()` is one case; Finding as soon as a check fails."""

    def __init__(self, seed: int = 1) -> None:
        self.stream: Any = RandomStream(seed, "gdb fuzz")
        self.board = Board()
        self.server = GdbServer(self.board, 0, ends=lambda: True)  # a halted board is released, no debugger waits
        self.server.begin()
        self.client = self._client()
        self.cases = self.frames = self.checked = 0
        self.heard = b""

    def _client(self) -> socket.socket:
        client = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        client.connect(("127.0.0.1", self.server.port))
        client.setblocking(False)
        return client

    def again(self) -> None:
        """Connect another debugger; the previous one has left without notice."""
        self.client.close()
        while self.server.peers:
            self.server._attend()
        self.client, self.heard = self._client(), b""
        while not self.server.peers:
            self.server._attend()

    def number(self, n: int) -> int:
        """Uniform in 0 ... n-1."""
        return int(self.stream.integer(n))

    def text(self) -> bytes:
        """A request with numbers, some of them extreme."""
        request = REQUESTS[self.number(len(REQUESTS))]
        while "{" in request:
            at = request.index("{")
            kind = request[at + 1]
            if kind == "a":
                shown = f"{PLACES[self.number(len(PLACES))] + self.number(8):x}"
            elif kind == "n":
                shown = f"{self.number(1 << (4, 8, 16, 32)[self.number(4)]):x}"
            else:
                shown = bytes(self.number(256) for _ in range(self.number(80))).hex()
            request = request[:at] + shown + request[at + 3 :]
        return request.encode()

    def case(self) -> None:
        """A hostile debugger sends something; the board continues if it may."""
        self.cases += 1
        what = self.number(40)
        if what == 0:
            self.again()
        elif what == 1:
            self.say(bytes(self.number(256) for _ in range(self.number(64))))
        elif what == 2:
            self.say(b"\x03")
        elif what == 3:
            frame = framed(self.text())
            self.say(frame[: self.number(len(frame) + 1)])
        elif what == 4:
            self.say(b"$" + self.text() + b"#00")
        elif what == 5:
            self.say(b"+" * self.number(20) + b"-" * self.number(5))
        else:
            self.say(b"".join(framed(self.text()) for _ in range(1 + self.number(3))))
        self.look()
        if not self.server.held:
            self.board.core.takes_aborts = True  # independent of the registers that were written
            self.board.core.needs_handlers = False
            self.board.core.run(self.board.core.cycles + CYCLES)
        if self.cases % CASES_TO_CHECK == 0:
            self.well_behaved()

    def say(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            self.client.send(data)

    def look(self) -> None:
        """Poll the port once, and read its output."""
        self.server._attend()
        most = self.server.limits.unread + self.server.limits.longest * 4
        for peer in self.server.peers:
            if len(peer.outgoing) > most:
                raise Finding(f"answers pile up: {len(peer.outgoing)} bytes (case {self.cases})")
        try:
            while data := self.client.recv(1 << 16):
                self.heard += data
        except BlockingIOError:
            self.understand()
            return
        except OSError:
            pass
        self.understand()
        self.again()  # it was disconnected, or requested that

    def understand(self) -> None:
        """Remove whole frames from the received bytes."""
        while True:
            self.heard = self.heard.lstrip(b"+-")
            if not self.heard:
                return
            if not self.heard.startswith(b"$"):
                raise Finding(f"no frame: {self.heard[:40]!r} (case {self.cases})")
            end = self.heard.find(b"#")
            if end < 0 or len(self.heard) < end + 3:
                return
            if int(self.heard[end + 1 : end + 3], 16) != sum(self.heard[1:end]) & 0xFF:
                raise Finding(f"a wrong checksum: {self.heard[:40]!r} (case {self.cases})")
            self.frames += 1
            self.last = self.heard[1:end]
            self.heard = self.heard[end + 3 :]

    def well_behaved(self) -> None:
        """A debugger connects, requests the stop reason and all registers, and disconnects."""
        self.again()
        for request, is_right in (
            (b"?", lambda answer: answer[:1] in (b"S", b"T")),
            (b"g", lambda answer: len(answer) >= 16 * 8 and not answer.startswith(b"E")),
            (b"D", lambda answer: answer == b"OK"),
        ):
            self.last = b""
            self.say(framed(request))
            for _ in range(LOOKS):
                if self.last:
                    break
                self.look()
            if not is_right(self.last):
                raise Finding(
                    f"a well-behaved debugger asked {request!r}, received {self.last[:40]!r} (case {self.cases})"
                )
        self.checked += 1
        before = self.board.core.instructions
        self.board.core.run(self.board.core.cycles + CYCLES)
        if self.board.core.instructions == before:
            raise Finding(f"the processor is halted after the debugger left (case {self.cases})")

    def counted(self) -> dict[str, int]:
        """Counts by name."""
        away = {f"sent_away_{reason}": count for reason, count in self.server.sent_away.items()}
        requests = {"requests": self.server.worked, "debuggers": self.server.seen}
        return {"cases": self.cases, **requests, "frames": self.frames, "well_behaved": self.checked, **away}

    def close(self) -> None:
        """Close the sockets."""
        self.client.close()
        self.server.close()


def run(cases: int, seed: int = 1) -> dict[str, int]:
    """Run `cases` cases; returns the counts."""
    fuzz = Fuzz(seed)
    with contextlib.closing(fuzz):
        for _ in range(cases):
            fuzz.case()
        return fuzz.counted()
