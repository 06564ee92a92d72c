"""What the servers over sockets have in common: connections that are read, understood, answered and written, polled.

No thread, nothing that blocks, nothing that raises because of a client. `attach.py` and `socketcand.py` say what the
bytes mean; `slcan.py` has the same outside (poll, filenos, counters, close) on a pseudo-terminal.
"""

import math
import socket
from collections.abc import Mapping
from contextlib import suppress
from typing import Generic, TypeVar

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge.taps import Tap, Taps, taps_of

CLIENT_LIMIT = 64  # chosen by us: a slip in a loop must not eat the plant process's file descriptors
BACKLOG_LIMIT = 1 << 20  # bytes that wait for a slow client before its frames are dropped: 38,000 frames
HELD_ABOVE = 1 << 16  # bytes; a bus at full speed waits for the client then
READ_SIZE = 1 << 16
NEXT_POLL_NS = 1_000_000  # while nothing waits; chosen by us: a frame from outside then waits 1 ms at most
QUICK_POLL_NS = 31_250  # while frames of clients wait: about a window of the lockstep
COUNTERS = ("clients_seen", "frames_in", "frames_out", "frames_dropped", "malformed", "refused")


class Connection:
    """One client: what it sent and we have not read to the end, what it has not taken, its node once it has one."""

    def __init__(self, connection: socket.socket) -> None:
        self.socket = connection
        self.incoming = bytearray()
        self.outgoing = bytearray()
        self.tap: Tap | None = None
        self.taps: Taps | None = None
        self.ending = False  # told why, to be closed when that is out


Client = TypeVar("Client", bound=Connection)


class StreamServer(Generic[Client]):
    """Serves `buses`, {channel: Bus or Taps}, to the connections that `listener` accepts."""

    def __init__(self, listener: socket.socket, buses: Mapping[str, Bus | Taps], epoch_ns: int) -> None:
        self.listener = listener
        self.epoch_ns = epoch_ns
        self.channels: dict[str, Taps] = {}
        self.own: list[Taps] = []
        for channel, bus in buses.items():
            self.channels[channel], mine = taps_of(bus)
            if mine:
                self.own.append(self.channels[channel])
        self.clients: list[Client] = []
        self.totals = dict.fromkeys(COUNTERS, 0)

    # ---- what a protocol adds

    def _welcomed(self, connection: socket.socket) -> Client | None:
        """The client of a new connection; None when it was sent away."""
        raise NotImplementedError

    def _understand(self, client: Client) -> None:
        """Take what is whole out of `client.incoming`."""
        raise NotImplementedError

    def _answer(self, client: Client) -> None:
        """What happened on the bus, into `client.outgoing`."""
        raise NotImplementedError

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
        return [self.listener.fileno(), *(client.socket.fileno() for client in self.clients)]

    def filenos_to_write(self) -> list[int]:
        """Descriptors on which something waits until the client takes more."""
        return [client.socket.fileno() for client in self.clients if client.outgoing]

    def patience_s(self) -> float:
        """Wall-clock seconds after which a poll has something to do even if nothing else happens."""
        return math.inf

    def counters(self) -> dict[str, int]:
        """Whole numbers by name: clients now, clients seen, frames in, out and dropped, malformed, refused."""
        return {"clients": sum(client.tap is not None for client in self.clients), **self.totals}

    def close(self) -> None:
        """End every connection, with what the last poll found."""
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
            client = self._welcomed(connection)
            if client is not None:
                self.clients.append(client)

    def _read(self, client: Client) -> None:
        """Everything that has arrived from one client."""
        if client.ending:
            return
        gone = False
        while True:
            try:
                data = client.socket.recv(READ_SIZE)
            except BlockingIOError:
                break
            except OSError:
                gone = True
                break
            client.incoming += data
            gone = not data
            if len(data) < READ_SIZE:
                break
        self._understand(client)
        if gone and not client.ending:
            self._drop(client)

    def _write(self, client: Client) -> None:
        """As much as the client takes now."""
        out = client.outgoing
        if out:
            try:
                sent = client.socket.send(out)
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

    def _drop(self, client: Client) -> None:
        """Close; what the client had queued is still sent."""
        if client not in self.clients:
            return
        self.clients.remove(client)
        if client.tap is not None and client.taps is not None:
            client.tap.held = False
            client.taps.remove(client.tap)
        with suppress(OSError):
            client.socket.close()
