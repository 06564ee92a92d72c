"""Connections to the panel: a bounded number, and none outlives its use.

The server's own limit answers each excess request and keeps the connection; a silent client keeps its connection
forever, and one that does not read is never closed, because its last bytes stay queued. Here the oldest connection
that is not a page is closed to free its place, and a refused client is cut off.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from ranger_sim.can_bus.edge.peers import REASONS, fault_of_owner

MOST = 64  # chosen by us: 16 pages, and 8 browsers that load one by six connections each
PATIENCE_S = 2.0  # for a client to read why it is refused; as can_bus/edge/peers.py
MADE_ROOM, NO_HTTP = "a connection that was not a page, dropped for a new one", "no HTTP"

Client = tuple[str, int]


class Connections:
    """`protocol`: the server's class of them. pages: clients that keep their place. refuse: called with a reason."""

    def __init__(self, pages: Callable[[], Collection[object]], refuse: Callable[[str], None]) -> None:
        self.pages = pages
        self.refuse = refuse
        self.transports: dict[Client, asyncio.Transport] = {}  # the oldest first
        connections = self

        class Protocol(H11Protocol):
            """HTTP, and WebSockets that begin as HTTP."""

            def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
                super().connection_made(transport)
                fault = fault_of_owner(transport.get_extra_info("socket"))
                if fault is not None:  # before anything is read or written
                    transport.abort()
                    connections.refuse(f"a connection that {REASONS[fault]}")
                    return
                connections.on_connection(transport)

            def data_received(self, data: bytes) -> None:
                try:
                    super().data_received(data)
                except h11.ProtocolError:  # raised for data after the last request that may be answered
                    self.transport.abort()
                    connections.refuse(NO_HTTP)

        self.protocol = Protocol

    def on_connection(self, transport: asyncio.Transport) -> None:
        """Register a connection; the oldest that is not a page may be closed."""
        for client in [client for client, each in self.transports.items() if _closed(each)]:
            del self.transports[client]
        if len(self.transports) >= MOST:
            pages = self.pages()
            oldest = next((client for client in self.transports if client not in pages), None)
            if oldest is not None:
                self.transports.pop(oldest).abort()
                self.refuse(MADE_ROOM)
        name: Any = transport.get_extra_info("peername")
        if name is not None:
            self.transports[name[:2]] = transport

    def ends(self, client: Client | None) -> None:
        """Close a page's connection within PATIENCE_S."""
        transport = self.transports.get(client) if client is not None else None
        if transport is not None:
            asyncio.get_running_loop().call_later(PATIENCE_S, transport.abort)


def _closed(transport: asyncio.Transport) -> bool:
    """True if its socket is closed."""
    return bool(transport.get_extra_info("socket").fileno() < 0)
