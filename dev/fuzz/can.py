"""Frames of every identifier and length, and bytes that are not frames, sent from outside to the buses of a whole
robot.

One case is one action of one client: a frame (any identifier, length and content), noise, a record cut or
changed; by the attach protocol, slcan or socketcand in turn. Every poll must return, a well-behaved client must still
be served, every board must keep its slots and stay on its bus. A robot that falls is replaced by the next one.
"""

from __future__ import annotations

import os
import socket
from contextlib import suppress
from typing import Any

from dev.fuzz import Finding
from ranger_sim.can_bus.edge import attach_records as wire
from ranger_sim.can_bus.edge.attach import AttachServer
from ranger_sim.can_bus.edge.slcan import SlcanServer
from ranger_sim.can_bus.edge.socketcand import SocketcandServer
from ranger_sim.can_bus.node import OPERATING
from ranger_sim.foundation.events import FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario

SLICE_NS = 1_000_000
CASES_PER_SLICE = 8
WORD = 1 << 32
ALIVE_NS = 5_000_000  # the slowest board's slot is 2 ms


class Fuzz:
    """`slice()` runs some cases and advances a millisecond; Finding as soon as a check fails."""

    def __init__(self, seed: int = 1) -> None:
        self.stream: Any = RandomStream(seed, "can fuzz")
        self.seed = seed
        self.robots = 0
        self.cases = 0
        self.totals: dict[str, int] = {}
        self.board_frames = 0
        self._start()

    def _start(self) -> None:
        """A new robot with its servers and clients."""
        self.robot = Ranger(Scenario(seed=self.seed + self.robots))
        self.robots += 1
        self.name = f"fuzz-{os.getpid()}-{self.robots}"
        buses = {bus.name: bus for bus in self.robot.buses}
        self.channels = list(buses)
        self.attach = AttachServer(self.name, buses)
        self.lines = [SlcanServer(channel, buses[channel]) for channel in self.channels]
        self.tcp = SocketcandServer(buses, 0)
        self.servers: list[Any] = [self.attach, *self.lines, self.tcp]
        self.ends = [os.open(line.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK) for line in self.lines]
        self.attached = [self._attached(number) for number in range(4)]
        self.daemons = [self._daemon(number) for number in range(4)]
        self.good = self._attached(0)
        self.good_data = bytearray()
        self.asked = self.answered = 0
        self.good_off = False
        for end in self.ends:
            os.write(end, b"O\r")

    def _attached(self, number: int) -> socket.socket:
        client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        client.connect(wire.address_of(self.name))
        client.setblocking(False)
        hello = wire.HELLO_BODY.pack(wire.MAGIC, wire.VERSION, 0) + self.channels[number].encode()
        client.sendall(wire.record(wire.HELLO, hello))
        return client

    def _daemon(self, number: int) -> socket.socket:
        client = socket.create_connection(("127.0.0.1", self.tcp.port))
        client.setblocking(False)
        client.sendall(f"< open {self.channels[number]} >< rawmode >".encode())
        return client

    def number(self, n: int) -> int:
        """Uniform in 0 ... n-1."""
        return int(self.stream.integer(n))

    def noise(self, count: int) -> bytes:
        return bytes(self.number(256) for _ in range(count))

    def frame(self) -> tuple[int, int, int, int]:
        """Any frame: standard identifiers in turn with every length in turn, some extended, some remote."""
        kind = self.number(8)
        flags = self.cases // 2048 % 9
        identifier = self.cases % 2048
        if kind == 0:
            identifier, flags = self.number(1 << 29), flags | FLAG_EXTENDED
        elif kind == 1:
            flags |= FLAG_REMOTE
        return identifier, flags, self.number(WORD), self.number(WORD)

    def spoilt(self, data: bytes) -> bytes:
        """One time in eight: noise, a byte changed, or the end cut off."""
        kind = self.number(24)
        if kind == 0:
            return self.noise(self.number(40))
        if kind == 1:
            place = self.number(len(data))
            return data[:place] + self.noise(1) + data[place + 1 :]
        return data[: self.number(len(data))] if kind == 2 else data

    def case(self) -> None:
        """One action of one client."""
        identifier, flags, lo, hi = self.frame()
        where, length, remote = self.number(4), flags & 15, flags & FLAG_REMOTE
        extended = flags & FLAG_EXTENDED
        name = f"{identifier:08X}" if extended else f"{identifier:03X}"
        data = (lo | hi << 32).to_bytes(8, "little")[:length]
        way = self.cases % 3
        self.cases += 1
        if way == 0:
            self._write(self.attached, where, self._attached, self.spoilt(wire.send_record(identifier, flags, lo, hi)))
        elif way == 1:
            letter = ("R" if remote else "T") if extended else ("r" if remote else "t")
            text = f"{letter}{name}{length}{'' if remote else data.hex()}\r"
            with suppress(BlockingIOError):
                os.write(self.ends[where], self.spoilt(text.encode()))
        else:
            text = f"< send {name} {length} {' '.join(f'{byte:x}' for byte in data)} >"
            self._write(self.daemons, where, self._daemon, self.spoilt(text.encode()))

    def _write(self, clients: list[socket.socket], where: int, again: Any, data: bytes) -> None:
        """Send to a client's server; over a new connection where the server has closed the old one."""
        try:
            with suppress(BlockingIOError):
                if clients[where].recv(1 << 20) == b"":
                    raise BrokenPipeError
            clients[where].send(data)
        except BlockingIOError:
            return
        except OSError:
            clients[where].close()
            clients[where] = again(where)

    def slice(self) -> None:
        """Run some cases, then a millisecond of the robot, then check all clients and boards."""
        for _ in range(CASES_PER_SLICE):
            self.case()
        if self.asked == self.answered and not self.good_off:
            self.good.send(wire.send_record(0, 1, 0x5A, 0))
            self.asked += 1
        for server in self.servers:
            server.poll(self.robot.loop.time)
        self.robot.run_for(SLICE_NS * 1e-9)
        self._hear()
        for end in self.ends:
            with suppress(BlockingIOError):
                while len(os.read(end, 4096)) == 4096:
                    pass
        for name, board in self.robot.boards.items():
            if self.robot.loop.time > 20_000_000 and self.robot.loop.time - board.scheduler.slot_time > ALIVE_NS:
                raise Finding(f"board {name} has stopped at {self.robot.loop.time} ns (case {self.cases})")
        if self.robot.ended:
            self.end()
            self._start()

    def _hear(self) -> None:
        """Check the well-behaved client: answered, or bus-off because of collisions and recovered."""
        with suppress(BlockingIOError):
            self.good_data += self.good.recv(1 << 20)
        for kind, body in wire.records_of(self.good_data):
            if kind in (wire.SENT, wire.DROPPED):
                self.answered += 1
            elif kind == wire.STATE:
                off = wire.STATE_BODY.unpack(body)[1] == 2
                if off and not self.good_off:
                    self.good.send(wire.record(wire.CONTROL, bytes([wire.ACTIVATE])))
                self.good_off = off
            elif kind == wire.REFUSED:
                raise Finding(f"the well-behaved client was refused: {body!r} (case {self.cases})")

    def end(self) -> None:
        """Add up and close; Finding when a board went bus-off."""
        for bus in self.robot.buses:
            for node in bus.nodes:
                if "client" in node.name or "slcan" in node.name:
                    continue
                self.board_frames += node.received
                if node.mode != OPERATING:
                    raise Finding(f"board {node.name} is off {bus.name}, mode {node.mode} (case {self.cases})")
        for server in self.servers:
            for counter, value in server.counters().items():
                self.totals[counter] = self.totals.get(counter, 0) + value
            server.close()
        for end in self.ends:
            os.close(end)
        for client in (*self.attached, *self.daemons, self.good):
            client.close()
        self.robot.close()


def run(cases: int, seed: int = 1) -> dict[str, int]:
    """Run `cases` cases; returns the counts of the servers and boards."""
    fuzz = Fuzz(seed)
    answered = 0
    while fuzz.cases < cases:
        robots = fuzz.robots
        fuzz.slice()
        answered = fuzz.answered if fuzz.robots == robots else 0
    fuzz.end()
    return {
        "cases": fuzz.cases,
        "robots": fuzz.robots,
        "answered_at_the_end": answered,
        "received_by_boards": fuzz.board_frames,
        **fuzz.totals,
    }
