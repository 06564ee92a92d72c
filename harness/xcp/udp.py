"""XCP on UDP: one master over datagrams (ASAM MCD-1 XCP, part 3: length and counter before each packet).

It keeps the rule of `can_bus/edge/peers.py` as far as datagrams allow: a poll carries out at most `burst` commands,
however they are packed; there is one master, other senders get no answer and are counted by reason, and machines
other than this one are served only on request. A datagram for which there is no space is dropped, and counted.

The master has its own socket on the same port, connected to it: the kernel keeps its datagrams separate from those of
strangers, who fill only their own queue. A poll takes a few from that queue, and only the sender of a CONNECT may need
an answer: the kernel is asked, a limited number of times a second, which user owns it.
"""

from __future__ import annotations

import socket
import struct
import sys
from collections import Counter, deque
from pathlib import Path
from typing import Any

from ranger_sim.can_bus.edge.peers import (
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
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.step_watch import StepWatch
from ranger_sim.harness.xcp.slave import FINE, Slave
from ranger_sim.harness.xcp.table_memory import TableMemory

MAX_CTO, MAX_DTO = 248, 1400  # bytes: a datagram fits into one frame of Ethernet
RULE = LIMITS["xcp-udp"]
DATAGRAMS_PER_POLL = RULE.read_bytes // RULE.longest
WAITING = 4096  # packets of measurements kept for the next poll; chosen by us: 2 s of one list at 0.5 ms
UNKNOWN_PER_POLL = 2  # datagrams; chosen by us: polling those that get no answer takes 10 us
QUESTIONS = 8  # to the kernel, at once; chosen by us: masters that a person starts and stops
GONE_S = 1.0  # between two questions whether the master has ended; chosen by us: the kernel lists its sockets for it
POLL_NS = 500_000  # virtual time between two polls: the fastest event
CONNECT, DISCONNECT = 0xFF, b"\xfe"  # codes of commands
HEADER = struct.Struct("<HH")


class _Sampling(StepWatch):
    """Samples the slave at every step of the plant, and changes nothing."""

    def __init__(self, server: XcpUdpServer) -> None:
        super().__init__()
        self.server = server

    def before_step(self, now_ns: int) -> object:
        self.server.sample(now_ns)
        return None


class XcpUdpServer:
    """A slave over `robot`'s data table on a UDP port (0: a free one; see `port`). Give it to `robot.attach`.

    UserError when the port is not available, or would be open to the network without `allow_network`.
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
        self.private: socket.socket | None = None  # the master's own; None where the kernel gives none
        self.counter = 0
        self.waiting: deque[bytes] = deque()
        self.sent_away: Counter[str] = Counter()
        self.totals = {"commands": 0, "packets_out": 0, "packets_dropped": 0}
        self.left_over = False  # datagrams may wait for the next poll
        self.rest, self.speaker = b"", ("", 0)  # of a datagram whose commands wait for the next poll, and its sender
        self.allowance = RULE.burst
        self.clock = wallclock.monotonic_s
        self.questions, self.asked_s = float(QUESTIONS), self.clock()  # to the kernel: how many, as of when
        self.ask_at_s = 0.0  # when to ask next whether the master has ended
        self.sampling = _Sampling(self)
        robot.loop.watchers.append(self.sampling)

    def sample(self, now_ns: int) -> None:
        """Queue what is measured at this time for the next poll."""
        if not self.slave.running:
            return
        for packet in self.slave.sample(now_ns, now_ns - self.robot.start_ns):
            if len(self.waiting) >= WAITING:
                self.totals["packets_dropped"] += 1
            else:
                self.waiting.append(packet)

    def poll(self, now_ns: int) -> int:
        """Handle commands that have arrived and send waiting measurements; returns the next poll's time, ns."""
        if self.master is not None and self.clock() >= self.ask_at_s:
            self.ask_at_s = self.clock() + GONE_S
            if self._master_is_gone():
                self._disconnect(now_ns)
        while self.waiting:
            self._send(self.waiting.popleft())
        self.allowance, self.left_over = RULE.burst, False
        self._carry_out(now_ns)
        if self.private is not None:
            self._read(self.private, DATAGRAMS_PER_POLL, now_ns)
        self._read(self.socket, UNKNOWN_PER_POLL, now_ns)
        return now_ns + POLL_NS

    def _read(self, source: socket.socket, strangers: int, now_ns: int) -> None:
        """Read a socket's datagrams: as many as a poll may take, and `strangers` that are not the master's."""
        for _ in range(DATAGRAMS_PER_POLL):
            if self.rest or strangers <= 0:
                self.left_over = True
                return
            try:
                data, sender = source.recvfrom(2048)
            except (BlockingIOError, InterruptedError):
                return
            except OSError:  # an earlier datagram found no receiver, or the master has just left
                if source.fileno() < 0:
                    return
                continue
            strangers -= sender != self.master
            self._take(data, sender, now_ns)
        self.left_over = True

    def _take(self, data: bytes, sender: tuple[str, int], now_ns: int) -> None:
        """Handle a datagram from any sender."""
        if sender != self.master and (fault := self._fault_of_stranger(data, sender, now_ns)) is not None:
            self.sent_away[fault] += 1
            return
        self.rest, self.speaker = data, sender
        self._carry_out(now_ns)

    def _fault_of_stranger(self, data: bytes, sender: tuple[str, int], now_ns: int) -> str | None:
        """Return why a sender that is not the master is refused; None when it may become the master."""
        if data[HEADER.size : HEADER.size + 1] != bytes((CONNECT,)):
            return FULL if self.slave.connected else MALFORMED
        if not self._may_ask():
            return FULL
        if self._master_is_gone():
            self._disconnect(now_ns)
        return self._fault_of(sender)

    def _may_ask(self) -> bool:
        """Whether the kernel may be asked now: as often as other servers may accept a connection."""
        now_s = self.clock()
        self.questions = min(float(QUESTIONS), self.questions + ARRIVALS_PER_S * (now_s - self.asked_s))
        self.asked_s = now_s
        if self.questions < 1.0:
            return False
        self.questions -= 1.0
        return True

    def _disconnect(self, now_ns: int) -> None:
        """End the session of a master that did not."""
        self.slave.command(DISCONNECT, now_ns)
        self._leave()

    def _leave(self) -> None:
        """Release the master's place."""
        self.master = None
        self.waiting.clear()
        if self.private is not None:
            self.private.close()
            self.private = None

    def _has_place(self, master: tuple[str, int]) -> None:
        """Make this sender the master, and receive its datagrams at a separate socket.

        The server's socket shares its port only now: while it was bound, no other program could bind it too. The
        kernel lets only this user's programs share it.
        """
        self._leave()
        self.master = master
        self.ask_at_s = self.clock() + GONE_S
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
        """Carry out the packets of a datagram in order, as far as this poll's limit of commands allows."""
        while self.rest and self.allowance > 0:
            data = self.rest
            length = HEADER.unpack_from(data)[0] if len(data) >= HEADER.size else 0
            packet, self.rest = data[HEADER.size : HEADER.size + length], data[HEADER.size + length :]
            if not 0 < length == len(packet):
                self.sent_away[MALFORMED] += 1
                self.rest = b""
                return
            self.allowance -= 1
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
        """True when the master was a program of this machine that has ended without DISCONNECT."""
        return self.master is not None and loopback(self.master[0]) and owner_of(self.master) is None

    def _fault_of(self, sender: tuple[str, int]) -> str | None:
        """Return why this sender is not served; None when it may be."""
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
        """What becomes readable when the master sends, or, without a master, when any client does."""
        return [(self.private or self.socket).fileno()]

    def counters(self) -> dict[str, int]:
        """Whole numbers by name."""
        away = {f"sent_away_{reason}": count for reason, count in self.sent_away.items()}
        return {**self.totals, "writes_refused": self.memory.refused, **away}

    def close(self) -> None:
        """Stop serving."""
        if self.sampling in self.robot.loop.watchers:
            self.robot.loop.watchers.remove(self.sampling)
        self._leave()
        self.socket.close()


def owner_of(sender: tuple[str, int]) -> int | None:
    """Return the user id behind a UDP port of this machine, by the kernel's table; None when it is not listed."""
    number = int.from_bytes(socket.inet_aton(sender[0]), sys.byteorder)
    wanted = {f"{number:08X}:{sender[1]:04X}", f"00000000:{sender[1]:04X}"}
    for line in Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]:
        cells = line.split()
        if cells[1] in wanted:
            return int(cells[7])
    return None
