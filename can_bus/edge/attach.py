"""Server on an abstract unix socket, through which other processes attach to emulated buses.

It has no thread and never blocks: the process that owns the buses polls it. Bad input from a client can only end that
client's connection; `can_bus/edge/peers.py` limits its requests.
"""

import errno
import socket
import struct
from collections.abc import Mapping

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge import attach_records as wire
from ranger_sim.can_bus.edge.attach_records import DEFAULT_NAME, MalformedError
from ranger_sim.can_bus.edge.peers import FULL, LIMITS, MALFORMED, REASONS, SocketStream
from ranger_sim.can_bus.edge.stream_server import Connection, StreamServer
from ranger_sim.can_bus.edge.taps import (
    DROPPED,
    NOT_ON_BUS,
    QUEUED,
    RECEIVED,
    SENT,
    STATE,
    Taps,
    fault_of_frame,
)
from ranger_sim.foundation.user_error import BusError

__all__ = ["DEFAULT_NAME", "AttachServer"]

EVENT_RECORD = {SENT: wire.SENT, DROPPED: wire.DROPPED}


class _Client(Connection):
    """One connection."""

    def __init__(self, connection: socket.socket) -> None:
        super().__init__(SocketStream(connection))
        self.outstanding = 0  # SEND records without an answer yet
        self.is_fd = False
        self.missed = 0
        self.overflowing = False
        self.state = b""  # the latest STATE record, while it does not fit


class AttachServer(StreamServer[_Client]):
    """Lets other processes attach to `buses`, {channel: Bus}, under `name`.

    UserError when the name is taken or impossible, or where there are no abstract sockets. `epoch_ns` is added to every
    stamp sent. A process that forks must close its copy.
    """

    def __init__(self, name: str, buses: Mapping[str, Bus | Taps], epoch_ns: int = 0) -> None:
        self.name = name
        address = wire.address_of(name)
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            listener.setblocking(False)
            listener.bind(address)
            listener.listen(LIMITS["attach"].peers)
        except OSError as error:
            listener.close()
            raise BusError(
                f"the name {name!r} is taken by another running robot or bus host: stop it, or choose another --name"
                if error.errno == errno.EADDRINUSE
                else f"attaching under the name {name!r}: {error.strerror}"
            ) from None
        super().__init__("attach", listener, buses, epoch_ns)

    def _welcome(self, connection: socket.socket) -> _Client:
        return _Client(connection)

    def _last_bytes(self, reason: str) -> bytes:
        """A REFUSED."""
        if reason == FULL:
            return self._refused(f"{self.name!r} has {self.limits.peers} clients already")
        return self._refused(f"this client {REASONS[reason]}")

    def _refused(self, reason: str) -> bytes:
        self.totals["refused"] += 1
        return wire.record(wire.REFUSED, reason.encode("utf-8")[: wire.RECORD_LIMIT - 1])

    def _take(self, client: _Client) -> bool:
        """The next record, if it is whole."""
        try:
            record = wire.next_record(client.incoming)
            if record is None:
                return False
            self._obey(client, *record)
        except MalformedError as fault:
            self.totals["malformed"] += 1
            self.send_away(client, MALFORMED, self._refused(str(fault)))
        return True

    def _obey(self, client: _Client, kind: int, body: bytes) -> None:
        """One record of a client."""
        if kind == wire.HELLO:
            self._handshake(client, body)
            return
        tap, taps = client.tap, client.taps
        if tap is None or taps is None:
            raise MalformedError(f"record type {kind} before HELLO")
        if kind == wire.SEND:
            identifier, flags, lo, hi = wire.frame_of(wire.SEND_HEAD, body)
            fault = fault_of_frame(identifier, flags, lo, hi, client.is_fd)
            if fault:
                raise MalformedError(fault)
            if client.outstanding >= tap.depth:
                raise MalformedError(f"more than the window of {tap.depth} frames without waiting for an answer")
            client.outstanding += 1
            answer = tap.offer(identifier, flags, lo, hi)
            if answer == QUEUED:
                self.totals["frames_in"] += 1
            elif answer == NOT_ON_BUS:
                tap.events.append((DROPPED, taps.time, identifier, flags, lo, hi))
        elif kind == wire.CONTROL:
            (request,) = wire.unpacked(struct.Struct("<B"), body)
            if request == wire.ACTIVATE:
                tap.activate(taps.time)
            elif request == wire.LISTEN:
                tap.listen(taps.time)
            elif request == wire.FLUSH:
                tap.flush(taps.time)
            else:
                raise MalformedError(f"control {request} is none of 1, 2, 3")
        else:
            raise MalformedError(f"record type {kind} is not for a client to send")

    def _handshake(self, client: _Client, body: bytes) -> None:
        """HELLO: the client becomes a node of its channel, or receives the list of channels."""
        if client.tap is not None:
            raise MalformedError("a second HELLO")
        if len(body) < wire.HELLO_BODY.size:
            raise MalformedError("a HELLO that is too short")
        magic, version, options = wire.HELLO_BODY.unpack_from(body)
        if magic != wire.MAGIC:
            raise MalformedError("a HELLO without the protocol's name")
        if version != wire.VERSION:
            reason = f"protocol version {version} is asked for, {self.name!r} speaks {wire.VERSION}"
            self.send_away(client, MALFORMED, self._refused(reason))
            return
        try:
            channel = body[wire.HELLO_BODY.size :].decode("utf-8")
        except UnicodeDecodeError:
            raise MalformedError("a channel's name that is not UTF-8") from None
        known = ", ".join(self.channels)
        window = bitrate = 0
        if channel:
            taps = self.channels.get(channel)
            if taps is None:
                reason = f"{self.name!r} has no channel {channel!r}; it has {known}"
                self.send_away(client, MALFORMED, self._refused(reason))
                return
            client.is_fd = bool(options & wire.OPTION_FD)
            if client.is_fd and not taps.bus.is_fd:
                self.send_away(client, MALFORMED, self._refused(f"{self.name}/{channel} is classic CAN, not CAN FD"))
                return
            if taps.full:
                self.send_away(client, FULL)
                return
            client.taps = taps
            client.tap = taps.add(f"{channel} client {self.totals['clients_seen']}", client.is_fd)
            self.totals["clients_seen"] += 1
            window, bitrate = client.tap.depth, taps.bus.bitrate
            if options & wire.OPTION_LISTEN:
                client.tap.listen(taps.time)
        names = "\n".join(self.channels).encode("utf-8")
        client.answer(
            wire.record(wire.WELCOME, wire.WELCOME_BODY.pack(wire.VERSION, window, bitrate, self.epoch_ns) + names)
        )
        if client.is_fd and client.taps is not None:
            bus = client.taps.bus
            client.answer(wire.record(wire.FD, wire.FD_BODY.pack(bus.data_bitrate, bus.iso)))

    def _report(self, client: _Client) -> None:
        """Send bus events as records. For a client that is far behind, frames are dropped and counted."""
        tap = client.tap
        if tap is None or not tap.events and not client.state:
            return
        events, tap.events = tap.events, []
        pack, size = wire.FRAME_RECORD.pack, 1 + wire.FRAME_BODY.size
        out, epoch, backlog = client.outgoing, self.epoch_ns, self.limits.backlog
        if client.state and len(out) < backlog:
            client.answer(client.state)
            client.state = b""
        for kind, time, a, b, c, d in events:
            if kind == STATE:
                state = wire.record(wire.STATE, wire.STATE_BODY.pack(time + epoch, a, min(b, 65535), min(c, 65535)))
                if len(out) < backlog:
                    client.answer(state)
                else:
                    client.state = state  # it replaces an older one
                continue
            if kind == RECEIVED:
                if len(out) >= backlog:
                    client.missed += 1
                    self.totals["frames_dropped"] += 1
                    client.overflowing = True
                    continue
                if client.overflowing:
                    client.overflowing = False
                    out += wire.record(wire.OVERFLOW, wire.OVERFLOW_BODY.pack(time + epoch, client.missed))
                self.totals["frames_out"] += 1
                if client.is_fd:
                    out += wire.frame_record(wire.FRAME, time + epoch, a, b, c, d)
                else:
                    out += pack(size, wire.FRAME, time + epoch, a, b, c, d)
            else:
                client.outstanding -= 1
                client.answer(wire.frame_record(EVENT_RECORD[kind], time + epoch, a, b, c, d))
