"""XCP on UDP: one master over datagrams (ASAM MCD-1 XCP, part 3: length and counter before each packet).

It keeps the rule of `foundation/peers.py` as far as datagrams have it: a look carries out at most `burst` commands,
however they are packed; one master has the place, who else speaks is not answered and counted by reason, and beyond
this machine nobody is served unless that is asked for. A datagram that finds no room is dropped, and counted.

The master has a socket of its own on the same port, connected to it: the kernel keeps its datagrams apart from those of
strangers, who fill only their own queue. Of that a look takes a few, and only to who says CONNECT is anything owed: the
kernel is asked, so many times a second, whose it is.
"""

from __future__ import annotations

import socket
import struct
import sys
from collections import Counter, deque
from pathlib import Path
from typing import Any

from ranger_sim.foundation import wallclock
from ranger_sim.foundation.peers import (
    ARRIVALS_PER_S,
    FOREIGN,
    FULL,
    LIMITS,
    MALFORMED,
    UNKNOWN,
    listening_address,
    loopback,
    trusted,
)
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.step_watch import StepWatch
from ranger_sim.harness.xcp.slave import FINE, Slave
from ranger_sim.harness.xcp.table_memory import TableMemory

MAX_CTO, MAX_DTO = 248, 1400  # bytes: a datagram fits into one frame of Ethernet
RULE = LIMITS["xcp-udp"]
DATAGRAMS_A_LOOK = RULE.read_bytes // RULE.longest
WAITING = 4096  # packets of measurements kept for the next look; chosen by us: 2 s of one list at 0.5 ms
STRANGERS_A_LOOK = 2  # datagrams of theirs; chosen by us: a look of what cannot be answered takes 10 us
QUESTIONS = 8  # for the kernel, at once; chosen by us: masters that come and go by hand
LOOK_NS = 500_000  # virtual time between two looks: the fastest event
CONNECT, DISCONNECT = 0xFF, b"\xfe"  # codes of commands
HEADER = struct.Struct("<HH")


class _Sampling(StepWatch):
    """Asks the slave at every step of the plant; measures, and changes nothing."""

    def __init__(self, server: XcpUdpServer) -> None:
        super().__init__()
        self.server = server

    def before_step(self, now_ns: int) -> object:
        self.server.sample(now_ns)
        return None


class XcpUdpServer:
    """A slave over `robot`'s data table on a UDP port (0: a free one; see `port`). Give it to `robot.attach`.

    UserError when the port cannot be had, or would be open to the network without `allow_network`.
    """

    kind = "xcp-udp"

    def __init__(self, robot: Any, port: int, host: str = "127.0.0.1", allow_network: bool = False) -> None:
        address = listening_address(host, f"XCP on {host}:{port}", allow_network)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self.socket.bind((address, port))
        except (OSError, OverflowError) as error:
            self.socket.close()
            reason = error.strerror if isinstance(error, OSError) else "a port is 0 ... 65535"
            raise UserError(f"XCP on {host}:{port}: {reason}") from None
        self.socket.setblocking(False)
        self.host, self.port = self.socket.getsockname()
        self.robot = robot
        self.memory = TableMemory(robot)
        self.slave = Slave(self.memory, MAX_CTO, MAX_DTO, FINE)
        self.master: tuple[str, int] | None = None
        self.private: socket.socket | None = None  # the master's own; it has none where the kernel gives none
        self.counter = 0
        self.waiting: deque[bytes] = deque()
        self.sent_away: Counter[str] = Counter()
        self.totals = {"commands": 0, "packets_out": 0, "packets_dropped": 0}
        self.left_over = False  # datagrams may wait for the next look
        self.rest, self.speaker = b"", ("", 0)  # of a datagram whose commands wait for the next look, and whose it is
        self.room = RULE.burst
        self.clock = wallclock.monotonic_s
        self.questions, self.asked_s = float(QUESTIONS), self.clock()  # for the kernel: room now, and when that was so
        self.sampling = _Sampling(self)
        robot.loop.watchers.append(self.sampling)

    def sample(self, now_ns: int) -> None:
        """What is measured at this instant waits for the next look."""
        if not self.slave.running:
            return
        for packet in self.slave.sample(now_ns, now_ns - self.robot.start_ns):
            if len(self.waiting) >= WAITING:
                self.totals["packets_dropped"] += 1
            else:
                self.waiting.append(packet)

    def poll(self, now_ns: int) -> int:
        """Commands that have come, measurements that wait; returns when it wants to be looked at next, ns."""
        while self.waiting:
            self._send(self.waiting.popleft())
        self.room, self.left_over = RULE.burst, False
        self._carry_out(now_ns)
        if self.private is not None:
            self._read(self.private, DATAGRAMS_A_LOOK, now_ns)
        self._read(self.socket, STRANGERS_A_LOOK, now_ns)
        return now_ns + LOOK_NS

    def _read(self, source: socket.socket, strangers: int, now_ns: int) -> None:
        """Datagrams of a socket: as many as a look may take, and so many that are not the master's."""
        for _ in range(DATAGRAMS_A_LOOK):
            if self.rest or strangers <= 0:
                self.left_over = True
                return
            try:
                data, sender = source.recvfrom(2048)
            except (BlockingIOError, InterruptedError):
                return
            except OSError:  # an earlier datagram found nobody there, or the master has just left
                if source.fileno() < 0:
                    return
                continue
            strangers -= sender != self.master
            self._take(data, sender, now_ns)
        self.left_over = True

    def _take(self, data: bytes, sender: tuple[str, int], now_ns: int) -> None:
        """A datagram, from whomever."""
        if sender != self.master and (fault := self._fault_of_stranger(data, sender, now_ns)) is not None:
            self.sent_away[fault] += 1
            return
        self.rest, self.speaker = data, sender
        self._carry_out(now_ns)

    def _fault_of_stranger(self, data: bytes, sender: tuple[str, int], now_ns: int) -> str | None:
        """Why somebody who has not got the place is not heard; None when it may have it."""
        if data[HEADER.size : HEADER.size + 1] != bytes((CONNECT,)):
            return FULL if self.slave.connected else MALFORMED
        if not self._may_ask():
            return FULL
        if self._master_is_gone():
            self.slave.command(DISCONNECT, now_ns)
            self._leave()
        return self._fault_of(sender)

    def _may_ask(self) -> bool:
        """Whether the kernel may be asked now: as often as a connection may be taken in at other doors."""
        now_s = self.clock()
        self.questions = min(float(QUESTIONS), self.questions + ARRIVALS_PER_S * (now_s - self.asked_s))
        self.asked_s = now_s
        if self.questions < 1.0:
            return False
        self.questions -= 1.0
        return True

    def _leave(self) -> None:
        """Nobody has the place."""
        self.master = None
        self.waiting.clear()
        if self.private is not None:
            self.private.close()
            self.private = None

    def _has_place(self, master: tuple[str, int]) -> None:
        """From now on this is the master, and its datagrams come to a socket of its own.

        The door shares its port only now: while it was bound, no other program could have it as well. The kernel
        lets this user's programs alone share.
        """
        self._leave()
        self.master = master
        own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
            own.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
            own.setblocking(False)
            own.bind((self.host, self.port))
            own.connect(master)
        except OSError:
            own.close()
        else:
            self.private = own

    def _carry_out(self, now_ns: int) -> None:
        """The packets of a datagram, in their order, as far as there is room for commands in this look."""
        while self.rest and self.room > 0:
            data = self.rest
            length = HEADER.unpack_from(data)[0] if len(data) >= HEADER.size else 0
            packet, self.rest = data[HEADER.size : HEADER.size + length], data[HEADER.size + length :]
            if not 0 < length == len(packet):
                self.sent_away[MALFORMED] += 1
                self.rest = b""
                return
            self.room -= 1
            self.totals["commands"] += 1
            answer = self.slave.command(packet, now_ns)
            if not answer:
                continue
            if self.master != self.speaker:
                self._has_place(self.speaker)
            self._send(answer)
            if not self.slave.connected:
                self._leave()

    def _master_is_gone(self) -> bool:
        """True when the one that has the place was a program of this machine that has ended without a word."""
        return self.master is not None and loopback(self.master[0]) and owner_of(self.master) is None

    def _fault_of(self, sender: tuple[str, int]) -> str | None:
        """Why this sender is not served; None when it may be."""
        if self.slave.connected:
            return FULL
        if not loopback(self.host):
            return None
        user = owner_of(sender)
        if user is None:
            return UNKNOWN
        return None if trusted(user) else FOREIGN

    def _send(self, packet: bytes) -> None:
        if self.master is None:
            return
        try:
            self.socket.sendto(HEADER.pack(len(packet), self.counter) + packet, self.master)
        except OSError:
            self.totals["packets_dropped"] += 1
        else:
            self.totals["packets_out"] += 1
        self.counter = (self.counter + 1) & 0xFFFF  # also of what is lost, so that the master sees it

    def filenos(self) -> list[int]:
        """What becomes readable when the master speaks, or while there is none whoever does."""
        return [(self.private or self.socket).fileno()]

    def counters(self) -> dict[str, int]:
        """Whole numbers by name."""
        away = {f"sent_away_{reason}": count for reason, count in self.sent_away.items()}
        return {**self.totals, "writes_refused": self.memory.refused, **away}

    def close(self) -> None:
        """Serve nobody any more."""
        if self.sampling in self.robot.loop.watchers:
            self.robot.loop.watchers.remove(self.sampling)
        self._leave()
        self.socket.close()


def owner_of(sender: tuple[str, int]) -> int | None:
    """The user id behind a UDP port of this machine, by the kernel's table; None when it is not there."""
    number = int.from_bytes(socket.inet_aton(sender[0]), sys.byteorder)
    wanted = {f"{number:08X}:{sender[1]:04X}", f"00000000:{sender[1]:04X}"}
    for line in Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]:
        cells = line.split()
        if cells[1] in wanted:
            return int(cells[7])
    return None
