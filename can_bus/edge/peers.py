"""Peers: external programs that connect. One rule limits what they may request; LIMITS is that rule as a table.

Every server follows it: attach, slcan, socketcand, the supervisor's requests, the serial lines, gdb, the feed, `trace
open`. Nothing here blocks, uses a thread, or raises because of a peer.

1. A poll (`PeerServer.receive`) reads at most `read_bytes` from each peer and executes at most `burst` requests of
   all peers, one of each in turn; over time at most `requests` per millisecond of robot time. It accepts at most
   ARRIVALS_PER_S connections per second of wall time, beyond those that would fill every place twice.
2. A peer that does not read is not read: while `unread` bytes of answers wait for it, nothing more is read from it.
   From `backlog` bytes on, data that it did not request (frames of a bus) is dropped and counted.
3. A poll writes at most `write_bytes` to each peer.
4. An endpoint accepts `peers` peers. When all places are taken, one peer is closed: one that no longer reads, although
   a request of it is still to be executed; otherwise one that has not completed its handshake. Of several, the one that
   has sent nothing for longest.
5. A peer that breaks the rule is disconnected and counted by reason (REASONS), which is shown to the user. Its
   unfinished requests are dropped.
6. Only programs of this user and of root are served, others are disconnected before the first byte either way, and no
   other server is trusted: SO_PEERCRED on local sockets; on
   loopback the kernel of Linux reports the owner of the other end. Owners on other machines are unknown, so listening
   beyond this machine must be requested explicitly. Other systems do not report owners: there a server on loopback
   serves every user of this machine, which its line of output says.
"""

from __future__ import annotations

import errno
import ipaddress
import math
import os
import socket
import struct
import sys
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from ranger_sim.foundation import systems, wallclock
from ranger_sim.foundation.descriptors import Readers
from ranger_sim.foundation.user_error import BusError


@dataclass(frozen=True)
class Limits:
    """One endpoint's row of the table; the rule above explains what each number limits."""

    peers: int
    requests: int  # in a millisecond of virtual time (of the wall clock while a robot is paused), of all peers together
    burst: int  # after a while without any, and per poll where there is no robot
    longest: int  # bytes of one request
    read_bytes: int
    write_bytes: int
    unread: int  # bytes of answers
    backlog: int  # bytes


# Chosen by us, for these reasons. peers: a peer on a bus receives every frame, and each costs 3 us, where a bus of the
# robot carries 4 per millisecond. requests: sending a frame costs some 50 us with all its consequences on the bus and
# in the boards (both measured on 23 November 2026, AMD EPYC); a real adapter of 1 Mbit/s sends 8 in a millisecond, a
# serial one of 1 Mbaud, or a daemon in front of it, 4. burst: attach, a window of its protocol. longest: attach, a
# reason; slcan, an extended frame has 26; socketcand, a send has 45; control, a request has below 100; gdb, the packet
# size that its stub reports, with its framing; a debugger requests little of a running board, and any amount of a
# halted one. trace, the head of a browser's request, including cookies of other servers of this machine. xcp-udp, a
# datagram in an Ethernet frame, of which a poll takes 16 and no more than `burst` commands. backlog: 8,000 frames, 0.3
# s of a full bus of 3 Mbit/s; feed, 3 s of all data that a robot records (2.6 MB a second).
KB = 1024
LIMITS = {
    #                    peers  requests  burst  longest  read_bytes  write_bytes  unread    backlog
    "attach":     Limits(   16,        8,    72,    1028,    4 * KB,     64 * KB,  64 * KB,  256 * KB),
    "slcan":      Limits(    1,        4,    32,      32,    4 * KB,      4 * KB,   4 * KB,   64 * KB),
    "socketcand": Limits(    8,        4,    32,     256,    4 * KB,     64 * KB,  64 * KB,  256 * KB),
    "control":    Limits(   32,        4,     8,    4096,    4 * KB,     64 * KB,  64 * KB,   64 * KB),
    "xcp-udp":    Limits(    1,       32,    16,    1500,   24 * KB,     64 * KB,        0,         0),
    "serial":     Limits(    1,        0,     0,       0,    2 * KB,      4 * KB,        0,         0),
    "gdb":        Limits(    1,        4,    64, 17 * KB,   16 * KB,     64 * KB,  64 * KB,         0),
    "feed":       Limits(    4,        0,     8,      64,    4 * KB,   1024 * KB,  64 * KB, 8192 * KB),
    "trace":      Limits(    8,        0,     8, 16 * KB,    4 * KB,    256 * KB,  64 * KB,         0),
}  # fmt: skip

ARRIVALS_PER_S = 250  # chosen by us: each costs some 80 us to accept, look up and refuse, 2 % of the time in all
PAUSED_S = 0.1  # virtual time has not advanced for this long: the robot is paused, not waiting for its time
PATIENCE_S = 2.0  # a peer that leaves answers unread for this long and has sent more is disconnected; chosen by us
MS = 1_000_000

# Why a peer is disconnected, as counted.
FULL, FOREIGN, UNKNOWN, MALFORMED = "full", "foreign", "unknown", "malformed"
TOO_LONG, STALLED, IDLE = "too_long", "stalled", "idle"
REASONS = {
    FULL: "found no place free",
    FOREIGN: "belonged to another user",
    UNKNOWN: "had gone before its owner could be identified",
    MALFORMED: "did not speak the protocol",
    TOO_LONG: "sent a request above the limit",
    STALLED: "went on without taking its answers",
    IDLE: "had left or not begun to take part, and was dropped for a new one",
}


class Stream(Protocol):
    """Bytes to and from a peer, without waiting. Raises OSError when it is gone."""

    def fileno(self) -> int:
        """What to wait on."""

    def read(self, limit: int) -> bytes | None:
        """Up to `limit` bytes; None when nothing has arrived, no bytes at the end of the stream."""

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Number of bytes taken."""

    def close(self) -> None:
        """Release it."""


class SocketStream:
    """A connection."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        self.connection = connection

    def fileno(self) -> int:
        return self.connection.fileno()

    def read(self, limit: int) -> bytes | None:
        try:
            return self.connection.recv(limit)
        except (BlockingIOError, InterruptedError):
            return None

    def write(self, data: bytes | bytearray | memoryview) -> int:
        try:
            return self.connection.send(data)
        except (BlockingIOError, InterruptedError):
            return 0

    def close(self) -> None:
        with suppress(OSError):
            self.connection.close()


class Terminal:
    """Our own pseudo-terminal, raw, for this user only; programs open `path`. UserError: none is available.

    Programs connect and disconnect, and are not distinguished. We keep their end open as well: otherwise the last
    program's close would reset the settings, and reading would fail until the next program opens it.
    """

    def __init__(self) -> None:
        try:
            import tty

            self.master, self.slave = os.openpty()
        except ImportError:
            raise BusError(f"pseudo-terminal: {sys.platform} does not have them") from None
        except OSError as error:
            raise BusError(f"pseudo-terminal: {error.strerror}") from None
        tty.setraw(self.slave)
        os.fchmod(self.slave, 0o600)
        os.set_blocking(self.master, False)
        self.path = os.ttyname(self.slave)

    def fileno(self) -> int:
        return self.master

    def read(self, limit: int) -> bytes | None:
        return read_ready(self.master, limit) or None

    def write(self, data: bytes | bytearray | memoryview) -> int:
        return write_ready(self.master, data)

    def close(self) -> None:
        for number in (self.master, self.slave):
            if number >= 0:
                os.close(number)
        self.master = self.slave = -1


def read_ready(number: int, limit: int) -> bytes:
    """Available bytes, without waiting."""
    try:
        return os.read(number, limit) if limit > 0 else b""
    except (BlockingIOError, InterruptedError):
        return b""


def write_ready(number: int, data: bytes | bytearray | memoryview) -> int:
    """Number of bytes taken without waiting."""
    try:
        return os.write(number, data)
    except (BlockingIOError, InterruptedError):
        return 0


class Peer:
    """One peer: bytes it sent that are not parsed yet, bytes it has not taken, and how many of those are answers."""

    def __init__(self, stream: Stream) -> None:
        self.stream = stream
        self.incoming = bytearray()
        self.outgoing = bytearray()
        self.answers = 0  # bytes of `outgoing` that it requested
        self.gone = False  # end of stream
        self.lost = False  # it no longer reads; its earlier requests are still processed
        self.lost_at_s = math.inf  # when that was found
        self.ending = False  # has been sent the reason, and is closed once that is written
        self.waits = False  # its last request is being executed: the next one has to wait
        self.last = 0  # the endpoint's count of requests and arrivals at its last one
        self.wants_since_s: float | None = None  # it has sent more, and read nothing

    def answer(self, data: bytes) -> None:
        """Queue bytes that the peer requested."""
        self.outgoing += data
        self.answers += len(data)

    def reads_too_little(self, limits: Limits) -> bool:
        """True while too many of its answers wait: nothing is read from it."""
        return self.answers >= limits.unread

    def write(self, limit: int) -> None:
        """Write as much as the peer takes now, up to `limit` bytes. OSError when it is gone."""
        if not self.outgoing:
            return
        # not a copy: a peer that reads nothing is offered 64 KB at every poll
        with memoryview(self.outgoing) as waiting, waiting[:limit] as part:
            taken = self.stream.write(part)
        if taken:
            del self.outgoing[:taken]
            self.answers = min(self.answers, len(self.outgoing))
            self.wants_since_s = None


P = TypeVar("P", bound=Peer)


def _use_of_place(peer: Peer) -> tuple[bool, int]:
    """Sort key for closing peers, lowest first: it no longer reads, or has sent nothing for longest."""
    return not peer.lost, peer.last


class PeerServer(Generic[P]):
    """A server endpoint: accepts peers, reads, has their requests executed, writes; a bounded amount per poll.

    A protocol adds `_welcome`, `_take`, and optionally `_takes_part` and `_closed`.
    """

    tolerated_s = PATIENCE_S
    lost_s = math.inf  # for so long requests of a peer that no longer reads are processed

    def __init__(self, kind: str, listener: socket.socket | None = None) -> None:
        self.kind = kind
        self.limits = LIMITS[kind]
        self.listener = listener
        self.peers: list[P] = []
        self.sent_away: Counter[str] = Counter()
        self.worked = 0  # requests executed so far
        self.arrived = 0  # connections accepted so far
        self.allowance = float(self.limits.burst)  # requests allowed now
        self.time_ns = 0
        self.first = 0  # whose turn it is
        self.left_over = False  # whole requests wait for the next poll
        self.connections_wait = False  # connections wait for it
        self.clock = wallclock.monotonic_s  # patience is measured on it
        self.polled_s = self.moved_s = -math.inf  # on `clock`: the last poll, the last one with virtual time advanced
        self.arrivals = 2.0 * self.limits.peers  # connections allowed now
        self.watch = Readers()
        if listener is not None:
            self.watch.add(listener.fileno())

    # ---- what a protocol adds

    def _welcome(self, connection: socket.socket) -> P:
        """The peer of a new connection."""
        raise NotImplementedError

    def _take(self, peer: P) -> bool:
        """Execute one whole request from `peer.incoming`; False when it holds none yet."""
        raise NotImplementedError

    def _takes_part(self, peer: P) -> bool:
        """True for a peer that keeps its place even when others want one."""
        return False

    def _last_bytes(self, reason: str) -> bytes:
        """Last bytes to a peer that is disconnected."""
        return b""

    def _closed(self, peer: P) -> None:
        """A peer has left, or is about to be sent the reason why it must."""

    # ---- for the process that owns it

    def receive(self, now_ns: int) -> None:
        """Accept peers, read, and execute requests, within the limits; `now_ns`: virtual time."""
        self._set_allowance(now_ns)
        ready = self._ready()
        arrives = self.listener is not None and self.listener.fileno() in ready
        self.connections_wait = arrives and self.arrivals < 1.0
        self.left_over = False
        peers = self.peers[self.first :] + self.peers[: self.first]
        waiting = [peer for peer in peers if self._read_from(peer, peer.stream.fileno() in ready)]
        if arrives:  # peers that have gone have released their places by now
            waiting += [peer for peer in self._accept() if self._read_from(peer, True)]
        while waiting and self.allowance >= 1.0:  # one of each in turn
            waiting = [peer for peer in waiting if self.allowance >= 1.0 and self._one(peer)]
        self.left_over = any(self._is_served(peer) for peer in waiting)
        self.first = (self.first + 1) % len(self.peers) if self.peers else 0

    def write(self) -> None:
        """Write to every peer what it takes now."""
        for peer in list(self.peers):
            self._write(peer)

    def filenos(self) -> list[int]:
        """Descriptors that become readable when a peer has a request that may be executed."""
        found = [] if self.listener is None or self.connections_wait else [self.listener.fileno()]
        return found + [peer.stream.fileno() for peer in self.peers if self._is_served(peer) and not peer.gone]

    def filenos_to_write(self) -> list[int]:
        """Descriptors with output that waits until the peer takes more."""
        return [peer.stream.fileno() for peer in self.peers if peer.outgoing]

    def send_away(self, peer: P, reason: str, apology: bytes = b"") -> None:
        """Count the reason, send it to the peer if it still reads, and close."""
        if peer.ending or peer not in self.peers:
            return
        self.sent_away[reason] += 1
        peer.answer(apology or self._last_bytes(reason))
        peer.incoming.clear()
        peer.ending = True
        self._closed(peer)
        if reason in (STALLED, IDLE):  # it reads nothing, or its place is needed now
            with suppress(OSError):
                peer.write(self.limits.write_bytes)
            self.drop(peer)

    def let_in(self, peer: P) -> None:
        """Start serving this peer."""
        self.peers.append(peer)
        self.watch.add(peer.stream.fileno())

    def drop(self, peer: P) -> None:
        """Close."""
        if peer in self.peers:
            self.peers.remove(peer)
            self.watch.remove(peer.stream.fileno())
            if not peer.ending:
                self._closed(peer)
            peer.stream.close()

    def close(self) -> None:
        """End every connection, and stop listening."""
        for peer in list(self.peers):
            self._write(peer)
            self.drop(peer)
        if self.listener is not None:
            self.listener.close()

    # ---- a poll

    def _set_allowance(self, now_ns: int) -> None:
        """Set how many requests and connections the time since the last poll allows. now_ns 0: no robot."""
        now_s = self.clock()
        passed_s = now_s - self.polled_s
        passed, self.time_ns = now_ns - self.time_ns, now_ns
        if passed > 0 or self.moved_s < 0.0:
            self.moved_s = now_s
        if now_ns == 0:  # the caller waits between two polls
            added = float(self.limits.burst)
        elif passed > 0:
            added = self.limits.requests * passed / MS
        elif now_s - self.moved_s > PAUSED_S:
            added = self.limits.requests * passed_s * 1e3
        else:
            added = 0.0
        self.allowance = min(float(self.limits.burst), self.allowance + added)
        self.arrivals = min(2.0 * self.limits.peers, self.arrivals + ARRIVALS_PER_S * passed_s)
        self.polled_s = now_s

    def _ready(self) -> set[int]:
        """Descriptors with something to read."""
        return self.watch.ready()

    def _accept(self) -> list[P]:
        """Accept connections; return the new peers, which may have sent something already."""
        assert self.listener is not None
        new: list[P] = []
        while self.arrivals >= 1.0:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                break
            self.arrivals -= 1.0
            if (fault := fault_of_owner(connection)) is not None:  # before anything is read or written
                self.sent_away[fault] += 1
                connection.close()
                continue
            peer = self._welcome(connection)
            self.arrived += 1
            peer.last = self.worked + self.arrived
            places = (each for each in self.peers if each.lost or not self._takes_part(each))
            idle = min(places, key=_use_of_place, default=None)
            full = len(self.peers) >= self.limits.peers
            if full and idle is not None:
                self.send_away(idle, IDLE)
            self.let_in(peer)
            if full and idle is None:
                self.send_away(peer, FULL)
            if peer.ending:  # it takes no place while the reason is sent to it
                self._write(peer)
                self.drop(peer)
            else:
                new.append(peer)
        return [peer for peer in new if peer in self.peers]

    def _read_from(self, peer: P, comes: bool) -> bool:
        """Read what is allowed from one peer; True when it may have a request."""
        if self.clock() - peer.lost_at_s > self.lost_s:
            self.send_away(peer, STALLED)
            return False
        if not self._is_served(peer):
            if peer.ending or not peer.waits and (comes or peer.incoming):
                self._wait_for(peer)
            return False
        if comes and len(peer.incoming) < self.limits.longest:
            try:
                data = peer.stream.read(self.limits.read_bytes)
            except OSError:
                data = b""
            if data is not None:
                peer.incoming += data
                peer.gone = not data
        if peer.gone and not peer.incoming:
            self.drop(peer)
        return bool(peer.incoming)

    def _is_served(self, peer: P) -> bool:
        """False for a peer that is being disconnected, has a request under way, or does not read its answers."""
        return not (peer.ending or peer.waits or peer.reads_too_little(self.limits))

    def _one(self, peer: P) -> bool:
        """Execute one request of a peer; True when it may have another."""
        if not self._is_served(peer):
            return False
        if self._take(peer):
            self.allowance -= 1.0
            self.worked += 1
            peer.last = self.worked + self.arrived
            return True
        if peer.gone and not peer.ending:
            self.drop(peer)
        elif len(peer.incoming) >= self.limits.longest:
            self.send_away(peer, TOO_LONG)
        return False

    def _wait_for(self, peer: P) -> None:
        """Limit how long a peer may go on without reading its output."""
        now_s = self.clock()
        if peer.wants_since_s is None:
            peer.wants_since_s = now_s
        elif now_s - peer.wants_since_s > self.tolerated_s:
            if peer.ending:
                self.drop(peer)
            else:
                self.send_away(peer, STALLED)

    def _write(self, peer: P) -> None:
        try:
            if not peer.lost:
                peer.write(self.limits.write_bytes)
        except OSError:
            peer.lost, peer.lost_at_s = True, self.clock()
        if peer.lost:
            peer.outgoing.clear()
            peer.answers = 0
        if peer.ending and not peer.outgoing:
            self.drop(peer)


# ---- trusted users


def trusted(user: int | None) -> bool:
    """True for this user and root."""
    return user in (os.getuid(), 0)


def user_behind(connection: socket.socket) -> int | None:
    """User id that owns the other end of a connection on this machine; None when that is unknown."""
    if connection.family == getattr(socket, "AF_UNIX", None):
        return int(struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[1])
    with suppress(OSError, ValueError):
        here, there = connection.getsockname()[:2], connection.getpeername()[:2]
        try:
            return _owner_in(_asked_of_kernel(there, here))
        except (OSError, struct.error):  # a kernel that does not report one connection has a table of all
            return _owner_of(there, here, Path("/proc/net/tcp").read_text(encoding="ascii"))
    return None


# sock_diag(7), linux/inet_diag.h. One connection is found in 25 us; the table of all, which the kernel writes for every
# reader, takes 11 to 19 ms (23 November 2026, AMD EPYC).
NETLINK_SOCK_DIAG, SOCK_DIAG_BY_FAMILY, NLM_F_REQUEST, NLMSG_ERROR = 4, 20, 1, 2
ESTABLISHED = 1  # TCP_ESTABLISHED; in any other state the end is closed, and its owner is reported as root
HEADER = struct.Struct("=IHHII")  # of a netlink message: length, type, flags, number, port
QUESTION = struct.Struct("=BBBBI")  # inet_diag_req_v2: family, protocol, extensions, padding, states; then the ends
ANSWER = struct.Struct("=BBBB48sIIIII")  # inet_diag_msg: family, state, ..., the ends, expires, queues, user, inode
NO_COOKIE = b"\xff" * 8


def _asked_of_kernel(end: tuple[str, int], other: tuple[str, int]) -> bytes:
    """The kernel's answer about the connection from `end` to `other`. OSError: it gives none."""
    ends = struct.pack(">HH", end[1], other[1])
    ends += b"".join(socket.inet_aton(each[0]).ljust(16, b"\0") for each in (end, other))
    body = QUESTION.pack(socket.AF_INET, socket.IPPROTO_TCP, 0, 0, 1 << ESTABLISHED) + ends + bytes(4) + NO_COOKIE
    head = HEADER.pack(HEADER.size + len(body), SOCK_DIAG_BY_FAMILY, NLM_F_REQUEST, 0, 0)
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, NETLINK_SOCK_DIAG) as kernel:
        kernel.setblocking(False)  # it answers within `send`
        kernel.send(head + body)
        return kernel.recv(4096)


def _owner_in(answer: bytes) -> int | None:
    """Owner of the end that a kernel answer describes; None when it is closed. OSError: unknown to the kernel."""
    _, kind, *_ = HEADER.unpack_from(answer)
    if kind == NLMSG_ERROR:
        error = -struct.unpack_from("=i", answer, HEADER.size)[0]
        if error == errno.ENOENT:
            return None
        raise OSError(error, os.strerror(error))
    _, state, _, _, _, _, _, _, user, inode = ANSWER.unpack_from(answer, HEADER.size)
    return int(user) if state == ESTABLISHED and inode else None


def _owner_of(end: tuple[str, int], other: tuple[str, int], table: str) -> int | None:
    """Owner of the end of an established connection, from the kernel's table (proc_net_tcp of its documentation)."""
    wanted = [_as_in_table(end), _as_in_table(other), "01"]  # 01: TCP_ESTABLISHED
    for line in table.splitlines()[1:]:
        cells = line.split()
        if cells[1:4] == wanted:
            return int(cells[7])
    return None


def _as_in_table(end: tuple[str, int]) -> str:
    """127.0.0.1 and a port as 0100007F:1F90, the address bytes in this machine's byte order."""
    return f"{int.from_bytes(socket.inet_aton(end[0]), sys.byteorder):08X}:{end[1]:04X}"


def owners_are_known() -> bool:
    """True where the system reports the user behind a connection of its loopback address: on Linux."""
    return systems.is_linux()


def fault_of_owner(connection: socket.socket) -> str | None:
    """Why a connection is refused; None for this user's, root's, and TCP connections whose owner the system does not
    report."""
    is_local = connection.family == getattr(socket, "AF_UNIX", None)
    if not is_local and not (owners_are_known() and loopback(connection.getsockname()[0])):
        return None
    user = user_behind(connection)
    if user is None:
        return UNKNOWN
    return None if trusted(user) else FOREIGN


def loopback(address: str) -> bool:
    """True for an address that only this machine can reach."""
    return ipaddress.ip_address(address).is_loopback


def listening_address(host: str, what: str, allow_network: bool) -> str:
    """The numeric address of `host`; UserError for an invalid one, or one beyond this machine without permission."""
    try:
        address = socket.gethostbyname(host)
    except OSError as error:
        raise BusError(f"{what}: {host!r}: {error.strerror or error}") from None
    if not loopback(address) and not allow_network:
        raise BusError(
            f"{what}: {host} is reached from beyond this machine, by anybody: give --allow-network if that is meant"
        )
    return address


def connected(address: str, whose: str, patience_s: float | None) -> socket.socket:
    """A connection to a local server of this user or root. OSError: nothing listens there; UserError: the owner is
    another user."""
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        connection.settimeout(patience_s)
        connection.connect(address)
        user = user_behind(connection)
        if not trusted(user):
            raise BusError(f"{whose} belongs to user {user}, not to you: it is not trusted")
    except BaseException:
        connection.close()
        raise
    return connection


def reasons_text(counts: dict[str, int] | Sequence[tuple[str, int]]) -> str:
    """`2 did not speak the protocol, 1 ...` for the user; empty when no peer was disconnected."""
    return ", ".join(f"{count} {REASONS[reason]}" for reason, count in dict(counts).items() if count)
