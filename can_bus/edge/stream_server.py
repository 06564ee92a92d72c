"""Common base of the bus servers: peers whose nodes are on buses, polled by the process that owns the buses.

`can_bus/edge/peers.py` limits every peer. `attach.py`, `socketcand.py` and `slcan.py` define the protocols.
"""

import math
import socket
from collections.abc import Mapping
from typing import TypeVar

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge.peers import ARRIVALS_PER_S, REASONS, Peer, PeerServer, Stream
from ranger_sim.can_bus.edge.taps import Tap, Taps, taps_of

HELD_ABOVE = 1 << 16  # bytes waiting for a client above which a bus at full speed waits for it
NEXT_POLL_NS = 1_000_000  # while nothing waits; chosen by us: an external frame then waits 1 ms at most
QUICK_POLL_NS = 250_000  # while frames of clients wait: three transmit buffers, so 12 full frames in a millisecond
COUNTERS = ("clients_seen", "frames_in", "frames_out", "frames_dropped", "malformed", "refused")


class Connection(Peer):
    """One client, with its node once it has one."""

    def __init__(self, stream: Stream) -> None:
        super().__init__(stream)
        self.tap: Tap | None = None
        self.taps: Taps | None = None


Client = TypeVar("Client", bound=Connection)


class StreamServer(PeerServer[Client]):
    """Serves `buses`, {channel: Bus or Taps}, to the peers of an endpoint of this `kind`."""

    def __init__(
        self, kind: str, listener: socket.socket | None, buses: Mapping[str, Bus | Taps], epoch_ns: int
    ) -> None:
        super().__init__(kind, listener)
        self.epoch_ns = epoch_ns
        self.held_above = min(HELD_ABOVE, self.limits.write_bytes)
        self.channels: dict[str, Taps] = {}
        self.own: list[Taps] = []
        for channel, bus in buses.items():
            self.channels[channel], mine = taps_of(bus)
            if mine:
                self.own.append(self.channels[channel])
        self.totals = dict.fromkeys(COUNTERS, 0)

    def _report(self, client: Client) -> None:
        """Write the events of the bus into `client.outgoing`."""
        raise NotImplementedError

    def _takes_part(self, peer: Client) -> bool:
        """A client on a bus keeps its place."""
        return peer.tap is not None

    # ---- for the process that owns the buses

    def poll(self, now_ns: int) -> int:
        """Read frames from clients, write frames of the buses; returns the latest time for the next poll, ns."""
        self.receive(now_ns)
        for taps in self.own:
            taps.poll(now_ns)
        self.deliver()
        busy = any(taps.queued for taps in self.channels.values())
        return now_ns + (QUICK_POLL_NS if busy else NEXT_POLL_NS)

    def deliver(self) -> None:
        """Write frames of the buses."""
        for client in self.peers:
            self._report(client)
        self.write()
        for client in self.peers:
            if client.tap is not None:
                client.tap.held = len(client.outgoing) > self.held_above

    def patience_s(self) -> float:
        """Wall-clock seconds after which a poll has work even if nothing else happens."""
        if self.left_over:
            return 0.0
        return 1.0 / ARRIVALS_PER_S if self.connections_wait else math.inf

    def counters(self) -> dict[str, int]:
        """Whole numbers by name: clients now, clients seen, frames in, out and dropped, malformed, refused.

        Also the number of disconnected clients, by reason.
        """
        away = {f"sent_away_{reason}": self.sent_away[reason] for reason in REASONS}
        return {"clients": sum(client.tap is not None for client in self.peers), **self.totals, **away}

    def close(self) -> None:
        """End every connection, after processing the results of the last poll."""
        for client in self.peers:
            self._report(client)
        super().close()

    def send_away(self, peer: Client, reason: str, apology: bytes = b"") -> None:
        """Drop its queued frames: a client that reconnects repeatedly must not fill the bus with old frames."""
        if peer.tap is not None and peer.taps is not None:
            peer.tap.flush(peer.taps.time)
        super().send_away(peer, reason, apology)

    def _closed(self, peer: Client) -> None:
        """Leave the bus; queued frames of a client that left by itself are still sent."""
        if peer.tap is not None and peer.taps is not None:
            peer.tap.held = False
            peer.taps.remove(peer.tap)
            peer.tap = None
