"""Where other processes attach to emulated buses: a server on an abstract unix socket.

It has no thread and never blocks: the process that owns the buses polls it. Nothing a client sends can do more than
end that client's own connection.
"""

import math
import os
import socket
import struct
from collections.abc import Mapping
from contextlib import suppress

from can_bus.bus import Bus
from can_bus.edge import attach_records as wire
from can_bus.edge.attach_records import DEFAULT_NAME, MalformedError
from can_bus.edge.taps import (
    DROPPED,
    NOT_ON_BUS,
    QUEUED,
    RECEIVED,
    SENT,
    STATE,
    Tap,
    Taps,
    fault_of_frame,
    taps_of,
)
from foundation.user_error import UserError

__all__ = ["DEFAULT_NAME", "AttachServer"]

CLIENT_LIMIT = 64  # chosen by us: a slip in a loop must not eat the plant process's file descriptors
BACKLOG_LIMIT = 1 << 20  # bytes that wait for a slow client before its frames are dropped: 38,000 frames
HELD_ABOVE = 1 << 16  # bytes; a bus at full speed waits for the client then
READ_SIZE = 1 << 16
NEXT_POLL_NS = 1_000_000  # while nothing waits; chosen by us: a frame from outside then waits 1 ms at most
QUICK_POLL_NS = 31_250  # while frames of clients wait: the lockstep's quantum
EVENT_RECORD = {RECEIVED: wire.FRAME, SENT: wire.SENT, DROPPED: wire.DROPPED}


class _Client:
    """One connection: what it sent and we have not read to the end, and what it has not taken."""

    def __init__(self, connection: socket.socket, number: int) -> None:
        self.connection = connection
        self.number = number
        self.incoming = bytearray()
        self.outgoing = bytearray()
        self.tap: Tap | None = None
        self.taps: Taps | None = None
        self.outstanding = 0  # SEND records without an answer yet
        self.missed = 0
        self.overflowing = False
        self.ending = False  # told why, to be closed when that is out


class AttachServer:
    """Lets other processes attach to `buses`, {channel: Bus}, under `name`.

    UserError when the name is taken or impossible, or where there are no abstract sockets. `epoch_ns` is added to
    every stamp that leaves. A process that forks must close its copy.
    """

    def __init__(self, name: str, buses: Mapping[str, Bus | Taps], epoch_ns: int = 0) -> None:
        self.name = name
        self.epoch_ns = epoch_ns
        self.channels: dict[str, Taps] = {}
        self.own: list[Taps] = []
        for channel, bus in buses.items():
            taps, mine = taps_of(bus)
            self.channels[channel] = taps
            if mine:
                self.own.append(taps)
        self.clients: list[_Client] = []
        self.totals = dict.fromkeys(("clients_seen", "frames_in", "frames_out", "frames_dropped", "malformed"), 0)
        self.totals["refused"] = 0
        address = wire.address_of(name)
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self.listener.setblocking(False)
            self.listener.bind(address)
            self.listener.listen(CLIENT_LIMIT)
        except OSError as error:
            self.listener.close()
            raise UserError(
                f"the name {name!r} is taken by another running robot or bus host: stop it, or choose another --name"
                if error.errno == 98  # EADDRINUSE
                else f"attaching under the name {name!r}: {error.strerror}"
            ) from None

    # ---- for the process that owns the buses

    def poll(self, now_ns: int) -> int:
        """Frames from clients in, frames of the buses out; returns the latest instant for the next poll, ns."""
        self._accept()
        for client in list(self.clients):
            self._read(client)
        for taps in self.own:
            taps.poll(now_ns)
        for client in list(self.clients):
            self._answer(client)
            self._write(client)
        busy = any(taps.queued for taps in self.channels.values())
        return now_ns + (QUICK_POLL_NS if busy else NEXT_POLL_NS)

    def filenos(self) -> list[int]:
        """Descriptors that become readable when a client wants something."""
        return [self.listener.fileno(), *(client.connection.fileno() for client in self.clients)]

    def filenos_to_write(self) -> list[int]:
        """Descriptors on which something waits until the client takes more."""
        return [client.connection.fileno() for client in self.clients if client.outgoing]

    def patience_s(self) -> float:
        """Wall-clock seconds after which a poll has something to do even if nothing else happens."""
        return math.inf

    def counters(self) -> dict[str, int]:
        """Whole numbers by name: clients now, clients seen, frames in, out and dropped, malformed, refused."""
        return {"clients": sum(client.tap is not None for client in self.clients), **self.totals}

    def close(self) -> None:
        """End every connection, with what the last poll found; the name is free again."""
        for client in list(self.clients):
            self._answer(client)
            self._write(client)
            self._drop(client)
        self.listener.close()

    # ---- connections

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            connection.setblocking(False)
            client = _Client(connection, self.totals["clients_seen"])
            self.clients.append(client)
            user = struct.unpack("3i", connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[1]
            if user not in (os.getuid(), 0):
                self._refuse(client, f"{self.name!r} belongs to another user")
            elif len(self.clients) > CLIENT_LIMIT:
                self._refuse(client, f"{self.name!r} has {CLIENT_LIMIT} clients already")

    def _read(self, client: _Client) -> None:
        """Everything that has arrived from one client."""
        if client.ending:
            return
        gone = False
        while True:
            try:
                data = client.connection.recv(READ_SIZE)
            except BlockingIOError:
                break
            except OSError:
                gone = True
                break
            if not data:
                gone = True
                break
            client.incoming += data
            if len(data) < READ_SIZE:
                break
        try:
            for kind, body in wire.records_of(client.incoming):
                self._take(client, kind, body)
                if client.ending:
                    return
        except MalformedError as fault:
            self.totals["malformed"] += 1
            self._refuse(client, str(fault))
        if gone:
            self._drop(client)

    def _take(self, client: _Client, kind: int, body: bytes) -> None:
        """One record of a client."""
        if kind == wire.HELLO:
            self._greet(client, body)
            return
        tap, taps = client.tap, client.taps
        if tap is None or taps is None:
            raise MalformedError(f"record type {kind} before HELLO")
        if kind == wire.SEND:
            identifier, flags, lo, hi = wire.unpacked(wire.SEND_BODY, body)
            fault = fault_of_frame(identifier, flags, lo, hi)
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
            (wish,) = wire.unpacked(struct.Struct("<B"), body)
            if wish == wire.ACTIVATE:
                tap.activate(taps.time)
            elif wish == wire.LISTEN:
                tap.listen(taps.time)
            elif wish == wire.FLUSH:
                tap.flush(taps.time)
            else:
                raise MalformedError(f"control {wish} is none of 1, 2, 3")
        else:
            raise MalformedError(f"record type {kind} is not for a client to send")

    def _greet(self, client: _Client, body: bytes) -> None:
        """HELLO: the client becomes a node of its channel, or hears which channels there are."""
        if client.tap is not None:
            raise MalformedError("a second HELLO")
        if len(body) < wire.HELLO_BODY.size:
            raise MalformedError("a HELLO that is too short")
        magic, version, options = wire.HELLO_BODY.unpack_from(body)
        if magic != wire.MAGIC:
            raise MalformedError("a HELLO without the protocol's name")
        if version != wire.VERSION:
            self._refuse(client, f"protocol version {version} is asked for, {self.name!r} speaks {wire.VERSION}")
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
                self._refuse(client, f"{self.name!r} has no channel {channel!r}; it has {known}")
                return
            client.taps = taps
            client.tap = taps.add(f"{channel} client {client.number}")
            self.totals["clients_seen"] += 1
            window, bitrate = client.tap.depth, taps.bus.bitrate
            if options & wire.OPTION_LISTEN:
                client.tap.listen(taps.time)
        names = "\n".join(self.channels).encode("utf-8")
        client.outgoing += wire.record(
            wire.WELCOME, wire.WELCOME_BODY.pack(wire.VERSION, window, bitrate, self.epoch_ns) + names
        )

    def _refuse(self, client: _Client, reason: str) -> None:
        """Say why and close."""
        self.totals["refused"] += 1
        client.outgoing += wire.record(wire.REFUSED, reason.encode("utf-8")[: wire.RECORD_LIMIT - 1])
        client.ending = True

    def _answer(self, client: _Client) -> None:
        """What happened on the bus, as records. Of a client that is far behind, frames are dropped and counted."""
        tap = client.tap
        if tap is None or not tap.events:
            return
        events, tap.events = tap.events, []
        pack, size = wire.FRAME_RECORD.pack, 1 + wire.FRAME_BODY.size
        out, epoch = client.outgoing, self.epoch_ns
        for kind, time, a, b, c, d in events:
            if kind == STATE:
                out += wire.record(wire.STATE, wire.STATE_BODY.pack(time + epoch, a, min(b, 65535), min(c, 65535)))
                continue
            if kind == RECEIVED:
                if len(out) >= BACKLOG_LIMIT:
                    client.missed += 1
                    self.totals["frames_dropped"] += 1
                    client.overflowing = True
                    continue
                if client.overflowing:
                    client.overflowing = False
                    out += wire.record(wire.OVERFLOW, wire.OVERFLOW_BODY.pack(time + epoch, client.missed))
                self.totals["frames_out"] += 1
            else:
                client.outstanding -= 1
            out += pack(size, EVENT_RECORD[kind], time + epoch, a, b, c, d)

    def _write(self, client: _Client) -> None:
        """As much as the client takes now."""
        out = client.outgoing
        if out:
            try:
                sent = client.connection.send(out)
            except BlockingIOError:
                sent = 0
            except OSError:
                self._drop(client)
                return
            del out[:sent]
        if client.tap is not None:
            client.tap.held = len(out) > HELD_ABOVE
        if client.ending and not out:
            self._drop(client)

    def _drop(self, client: _Client) -> None:
        """Close; what the client had queued is still sent."""
        if client not in self.clients:
            return
        self.clients.remove(client)
        if client.tap is not None and client.taps is not None:
            client.tap.held = False
            client.taps.remove(client.tap)
        with suppress(OSError):
            client.connection.close()
