"""One of the robot's buses outside the simulation: every controller is a separate peer on a python-can interface.

Each controller has a python-can bus to itself, so on SocketCAN the boards receive each other, candump and all other
programs, exactly as separate programs would. All peers live in the process that owns virtual time, because external
frames get their stamps there; a board's process never sees a wall clock.

Such a bus is asynchronous: received frames depend on the wall clock, and no run on it can be repeated. Arbitration,
acknowledgement and the wire are those of the interface; here a controller is busy for the nominal length of its
frame. Frames that do not fit are counted: `not_taken` (the interface's queue was full, tried again), `overflow`
(external frames faster than the bus could carry them), `refused` (CAN FD on a classic bus, or for a classic board).

The robot uses a small set of plain methods (`from_board`, `poll`), as for the other ends of wires.
"""

import argparse
import collections
import errno
import shlex
import socket
import struct
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NoReturn

import can
from can import cli as can_options

from ranger_sim.can_bus.edge.messages import frame_of_message, message_of_frame
from ranger_sim.can_bus.fd_frame import PHASE_SHIFT, phases
from ranger_sim.can_bus.frame import INTERMISSION_BITS, LENGTH_CODE, frame_bits
from ranger_sim.can_bus.frame_bytes import data_of_words
from ranger_sim.foundation.descriptors import Readers
from ranger_sim.foundation.events import (
    CAN_ABORT,
    CAN_MODE,
    CAN_REQUEST,
    CAN_RX,
    CAN_TX_DONE,
    FLAG_ERROR,
    FLAG_FD,
    FLAG_SINGLE_SHOT,
    TX_ABORTED,
    TX_LOST,
    TX_SENT,
)
from ranger_sim.foundation.user_error import BusError, UserError

# Virtual time between two polls of the interfaces: half a step of the plant. Chosen by us: less has no benefit, as the
# boards' outputs act at the plant's next step, and much more would affect the control loops (500 Hz).
POLL_NS = 125_000
# Frames read together are delivered one after the other, as on a bus; further ahead than this they are dropped.
# Chosen by us: ten slots of the main brain, more than any queue in the robot holds.
AHEAD_NS = 20_000_000
RECEIVE_BYTES = 8 << 20  # of a socket: some 10,000 frames wait there while the robot computes; chosen by us
SO_RCVBUFFORCE, SO_MEMINFO, MEMINFO_DROPS = 33, 55, 8  # socket(7) and linux/sock_diag.h: the ninth word counts drops
READ_LIMIT = 200  # frames per peer and poll, so that a flood does not stop virtual time


class _Options(argparse.ArgumentParser):
    """python-can's arguments; a mistake in them is the user's."""

    def error(self, message: str) -> NoReturn:
        raise BusError(message)


def place_of(text: str) -> tuple[str, dict[str, Any]]:
    """("can1", keywords for can.Bus) of `can1=socketcan:vcan0`, the value of the option --bus.

    Options of python-can may follow, as its own programs take them (`can1=slcan:/dev/ttyACM0 --bitrate
    1000000`). Omitted parts, the interface (`can1=vcan0`) or everything (`can1=`), come from python-can's
    configuration: its environment variables and its files, there from the section named like the bus.
    """
    name, equals, where = text.partition("=")
    if not equals or not name:
        raise BusError(f"--bus {text}: BUS=INTERFACE:CHANNEL is expected, e.g. can1=socketcan:vcan0")
    words = shlex.split(where)
    head = words.pop(0) if words and not words[0].startswith("-") else ""
    found: dict[str, Any] = {}
    interface, colon, channel = head.partition(":")
    if colon:
        if not channel:
            raise BusError(f"--bus {text}: no channel after {interface}:")
        if interface not in can.VALID_INTERFACES:
            known = ", ".join(sorted(can.VALID_INTERFACES))
            raise BusError(f"--bus {text}: python-can knows no interface {interface}; it knows {known}")
        found = {"interface": interface, "channel": channel}
    elif head:
        found = {"channel": head}
    parser = _Options(prog=f"--bus {name}", add_help=False)
    can_options.add_bus_arguments(parser)
    try:
        options = vars(parser.parse_args(words))
    except (UserError, argparse.ArgumentError) as mistake:
        raise BusError(f"--bus {text}: {mistake}") from None
    return name, {**found, **options.pop("bus_kwargs", {}), **options}


def opener(name: str, keywords: dict[str, Any]) -> Callable[[], Any]:
    """A function that opens one python-can bus with these keywords; python-can's configuration fills in the rest.

    UserError where neither names an interface.
    """
    try:
        can.util.load_config(config=dict(keywords), context=name)
    except can.CanInterfaceNotImplementedError as error:
        raise BusError(
            f"bus {name}: python-can finds no interface for it ({error}): name one, as in {name}=socketcan:vcan0, or "
            f"set `interface` in section [{name}] of python-can's configuration (~/.canrc, ./can.ini, CAN_INTERFACE)"
        ) from None

    def open_peer() -> Any:
        try:
            connection = can.Bus(config_context=name, **keywords)
        except Exception as error:  # a driver raises many types when its device is missing
            where = ":".join(str(keywords.get(each, "(by configuration)")) for each in ("interface", "channel"))
            text = " ".join(str(error).split()) or type(error).__name__
            raise BusError(f"bus {name} on {where}: {text}{hint_for(error, keywords)}") from None
        widen(connection)
        return connection

    return open_peer


def hint_for(error: Exception, keywords: dict[str, Any]) -> str:
    """Hints for two common failures."""
    if isinstance(error, OSError) and error.errno == errno.ENODEV:
        channel = keywords.get("channel", "vcan0")
        return f" (`ip link add {channel} type vcan && ip link set {channel} up` makes a virtual one)"
    if isinstance(error, OSError) and error.errno == errno.EAFNOSUPPORT:
        return " (this kernel has no SocketCAN; `python -m dev.vm` has one)"
    return ""


def widen(connection: Any) -> None:
    """Let a socket hold more frames, as far as the system permits."""
    end = getattr(connection, "socket", None)
    if isinstance(end, socket.socket):
        for option in (socket.SO_RCVBUF, SO_RCVBUFFORCE):
            with suppress(OSError):
                end.setsockopt(socket.SOL_SOCKET, option, RECEIVE_BYTES)


def dropped_by_kernel(connection: Any) -> int:
    """Frames that did not fit into the socket so far; 0 where the interface is not a socket."""
    end = getattr(connection, "socket", None)
    if not isinstance(end, socket.socket):
        return 0
    try:
        words = end.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, 36)
    except OSError:
        return 0
    drops: int = struct.unpack_from("=I", words, 4 * MEMINFO_DROPS)[0]
    return drops


class Peer:
    """One controller of a board on the interface. Fields as those of a node of an emulated bus.

    is_fd: whether the board's controller knows CAN FD; a classic one gets no CAN FD frame.
    """

    def __init__(
        self,
        owner: "ExternalBus",
        label: str,
        connection: Any,
        inbox: Any,
        controller: int,
        order: int,
        is_fd: bool = False,
    ) -> None:
        self.owner = owner
        self.label = label
        self.connection = connection
        self.inbox = inbox
        self.controller = controller
        self.order = order
        self.is_fd = is_fd
        self.operating = True
        self.descriptor = -1
        # an interface without a descriptor to wait on is polled
        with suppress(NotImplementedError, OSError, ValueError):
            self.descriptor = connection.fileno()
        self.waiting: collections.deque[tuple[int, int, int, int, int]] = collections.deque()
        self.free_ns = 0  # end of its latest frame on the wire
        self.read_ns = 0  # end of the latest frame delivered to the board
        self.unreadable = ""

    def from_board(self, kind: int, time: int, b: int, c: int, d: int, e: int, f: int) -> None:
        """A request of the board's controller: the fields of CAN_REQUEST, CAN_ABORT or CAN_MODE."""
        if kind == CAN_REQUEST:
            if not self.operating:
                self._done(time, b, TX_ABORTED)
                return
            self.waiting.append((b, c, d, e, f))
            self.flush(time)
        elif kind == CAN_ABORT:
            self._drop(time, {b})
        elif kind == CAN_MODE:
            self.operating = b == 0
            if not self.operating:
                self._drop(time, {1, 2, 3})

    def flush(self, time: int) -> None:
        """Pass waiting frames to the interface, as far as it takes them."""
        while self.waiting:
            buffer, identifier, flags, lo, hi = self.waiting[0]
            message = message_of_frame(0, identifier, flags & ~FLAG_SINGLE_SHOT, lo, hi, is_rx=False)
            try:
                self.connection.send(message, timeout=0)
            except (can.CanError, OSError, ValueError) as error:
                self.owner.not_taken += 1
                self.owner.last_error = f"{self.label}: {error}"
                if flags & FLAG_SINGLE_SHOT:  # one attempt: it is over
                    self.waiting.popleft()
                    self._done(time, buffer, TX_LOST)
                    self.owner.single_shot_skipped += 1
                    continue
                return
            self.waiting.popleft()
            self.owner.frames_out += 1
            self.free_ns = max(time, self.free_ns) + self.owner.length_ns(identifier, flags, lo, hi)
            self._done(self.free_ns, buffer, TX_SENT)
            self.owner.seen(self, self.free_ns, identifier, flags & ~FLAG_SINGLE_SHOT, lo, hi)

    def read(self, now_ns: int) -> None:
        """Deliver the received frames, one after the other."""
        for _ in range(READ_LIMIT):
            try:
                message = self.connection.recv(0)
            except (can.CanError, OSError, ValueError) as error:
                self.unreadable = str(error)
                self.owner.last_error = f"{self.label}: {error}"
                return
            self.unreadable = ""
            if message is None:
                return
            try:
                identifier, flags, lo, hi = frame_of_message(message, self.owner.is_fd)
            except UserError:
                self.owner.refused += 1
                continue
            if flags & FLAG_ERROR:
                self.owner.count_error(self)
                continue
            if not flags & FLAG_FD:
                flags = flags & ~LENGTH_CODE | min(flags & LENGTH_CODE, 8)
            end_ns = max(now_ns, self.read_ns + self.owner.length_ns(identifier, flags, lo, hi))
            self.owner.frames_in += self is self.owner.peers[0]
            self.owner.seen(self, min(end_ns, now_ns + AHEAD_NS), identifier, flags, lo, hi)
            if end_ns > now_ns + AHEAD_NS:
                self.owner.overflow += 1
                continue
            self.read_ns = end_ns
            if flags & FLAG_FD and not self.is_fd:
                self.owner.refused += 1
            elif self.operating and flags & FLAG_FD:
                data, second = data_of_words(flags, lo, hi), hi & 0xFFFFFFFF  # as a bus of the machine gives them
                self.inbox.push(end_ns, self.order, CAN_RX, self.controller, identifier, flags, lo, second, 0, data)
            elif self.operating:
                self.inbox.push(end_ns, self.order, CAN_RX, self.controller, identifier, flags, lo, hi)

    def _drop(self, time: int, buffers: set[int]) -> None:
        for entry in [each for each in self.waiting if each[0] in buffers]:
            self.waiting.remove(entry)
            self._done(time, entry[0], TX_ABORTED)

    def _done(self, time: int, buffer: int, status: int) -> None:
        self.inbox.push(time, self.order, CAN_TX_DONE, self.controller, buffer, status)


class ExternalBus:
    """Bus `name` of the robot at `bit_rate` (bit/s, for the length of frames). `open_peer` gives python-can buses.

    data_bit_rate: bit/s of the data of CAN FD; 0: a classic bus.
    `sinks`: functions (time_ns, identifier, flags, lo, hi) that receive every frame once, as the first peer does.
    """

    asynchronous = True

    def __init__(self, name: str, bit_rate: int, open_peer: Callable[[], Any], data_bit_rate: int = 0) -> None:
        self.name = name
        self.bit_rate = bit_rate
        self.data_bit_rate = data_bit_rate
        self.is_fd = data_bit_rate > 0
        self.open_peer = open_peer
        self.peers: list[Peer] = []
        self.poller = Readers()
        self.sinks: list[Callable[[int, int, int, int, int], Any]] = []
        self.frames_in = 0
        self.frames_out = 0
        self.not_taken = 0
        self.overflow = 0
        self.refused = 0
        self.errors = 0
        self.single_shot_skipped = 0
        self.last_error = ""
        self.busy_ns = 0
        self.window_ns = 0
        self.window_busy_ns = 0
        self.window_load = 0.0

    def add_peer(
        self,
        label: str,
        inbox: Any,
        controller: int,
        order: int,
        open_peer: Callable[[], Any] | None = None,
        is_fd: bool = False,
    ) -> Peer:
        """A controller of a board, with CAN FD or without; UserError when the interface cannot be opened."""
        peer = Peer(self, label, (open_peer or self.open_peer)(), inbox, controller, order, is_fd)
        self.peers.append(peer)
        if peer.descriptor >= 0:
            self.poller.add(peer.descriptor)
        return peer

    def remove_peer(self, peer: Peer) -> None:
        """Remove a peer of `add_peer` from the bus; its waiting frames are not sent."""
        self.peers.remove(peer)
        if peer.descriptor >= 0:
            self.poller.remove(peer.descriptor)
        peer.connection.shutdown()

    def poll(self, now_ns: int) -> int:
        """Receive frames and send waiting ones; returns the time of the next poll."""
        ready = self.poller.ready()  # one query for all: recv queries again
        for peer in self.peers:
            if peer.waiting:
                peer.flush(now_ns)
            if peer.descriptor < 0 or peer.descriptor in ready:
                peer.read(now_ns)
        return now_ns + POLL_NS

    def drain(self, now_ns: int) -> None:
        """Finish: record frames that were sent before the end."""
        while True:
            before = self.frames_in
            self.poll(now_ns)
            if self.frames_in == before:
                return

    def length_ns(self, identifier: int, flags: int, lo: int, hi: int) -> int:
        """Time for which such a frame occupies the wire, intermission included."""
        if flags & FLAG_FD:
            both = phases(identifier, flags & ~FLAG_SINGLE_SHOT, data_of_words(flags, lo, hi))
            fast, slow = both >> PHASE_SHIFT, (both & (1 << PHASE_SHIFT) - 1) + INTERMISSION_BITS
            return slow * 1_000_000_000 // self.bit_rate + fast * 1_000_000_000 // self.data_bit_rate
        bits = frame_bits(identifier, flags & ~FLAG_SINGLE_SHOT, lo, hi) + INTERMISSION_BITS
        return bits * 1_000_000_000 // self.bit_rate

    def seen(self, peer: Peer, time_ns: int, identifier: int, flags: int, lo: int, hi: int) -> None:
        """Count a frame that the first peer sent or received as one frame of this bus."""
        if peer is not self.peers[0]:
            return
        length_ns = self.length_ns(identifier, flags, lo, hi)
        if time_ns - self.window_ns >= 10_000_000:  # windows of 10 ms, as on the emulated buses
            self.window_load = min(1.0, self.window_busy_ns / max(1, time_ns - self.window_ns))
            self.window_ns, self.window_busy_ns = time_ns, 0
        self.window_busy_ns += length_ns
        self.busy_ns += length_ns
        for sink in self.sinks:
            sink(time_ns, identifier, flags, lo, hi)

    def count_error(self, peer: Peer) -> None:
        """Pass an error frame reported by the interface to every peer."""
        if peer is self.peers[0]:
            self.errors += 1

    def filenos(self) -> list[int]:
        """Descriptors to select on for reading, where the interface has any."""
        return [peer.descriptor for peer in self.peers if peer.descriptor >= 0 and not peer.unreadable]

    def counters(self) -> dict[str, int]:
        """Whole numbers for the live view and the summary."""
        return {
            "frames_in": self.frames_in,
            "frames_out": self.frames_out,
            "not_taken": self.not_taken,
            "overflow": self.overflow + sum(dropped_by_kernel(peer.connection) for peer in self.peers),
            "refused": self.refused,
            "error_frames": self.errors,
            "single_shot_skipped": self.single_shot_skipped,
        }

    def close(self) -> None:
        """Leave the interfaces."""
        for peer in self.peers:
            with suppress(can.CanError, OSError):
                peer.connection.shutdown()
