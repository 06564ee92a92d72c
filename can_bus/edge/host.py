"""A host of private buses: advances their time and serves attached clients, in one thread without busy waiting."""

from typing import Any

from ranger_sim.can_bus.edge.paced import PacedBus
from ranger_sim.foundation import descriptors, wallclock
from ranger_sim.foundation.events import NEVER

LONGEST_NAP_S = 1.0  # limits the delay of a user's interrupt; chosen by us


class BusHost:
    """Some buses and their servers (`AttachServer`, `SlcanServer`, `SocketcandServer`, given by `serve`)."""

    def __init__(self, buses: list[PacedBus]) -> None:
        self.buses = buses
        self.servers: list[Any] = []
        now, epoch = wallclock.monotonic_ns(), wallclock.epoch_ns()
        for bus in buses:  # one clock for all
            bus.started_ns, bus.epoch_ns = now, epoch

    def serve(self, server: Any) -> None:
        """Poll this server from now on; it was created with the buses' `taps`."""
        self.servers.append(server)

    def turn(self, patience_s: float = LONGEST_NAP_S) -> None:
        """Run one cycle: read client requests, advance time, write to clients; then wait for the next event.

        Nothing is read from clients after the last advance: their frames would wait until the sleep ends.
        """
        due = NEVER
        for bus in self.buses:
            bus.advance()
        for server in self.servers:
            server.poll(0)
        for bus in self.buses:
            due = min(due, bus.advance())
        if any(tap.events for bus in self.buses for tap in bus.taps.taps):
            for server in self.servers:
                server.deliver()
        nap = min([patience_s, *(server.patience_s() for server in self.servers)])
        if due < NEVER and not any(bus.held() for bus in self.buses):
            nap = min(nap, self.buses[0].seconds_until(due))
        readable = [fd for server in self.servers for fd in server.filenos()]
        writable = [fd for server in self.servers for fd in server.filenos_to_write()]
        descriptors.wait(readable, writable, nap)

    def close(self) -> None:
        """End every server."""
        for server in self.servers:
            server.close()
