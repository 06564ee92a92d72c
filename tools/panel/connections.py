"""Connections to the panel: a bounded number, and none outlives its use.

The server's own limit answers each request too many and keeps the connection; who says nothing keeps his for ever, and
one that takes nothing is never closed, because its last bytes wait. So here the oldest that is no page makes room, and
who was sent away is cut off.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

MOST = 64  # chosen by us: 16 pages, and 8 browsers that load one by six connections each
PATIENCE_S = 2.0  # to take why it is sent away; as foundation/peers.py
MADE_ROOM, NO_HTTP = "a connection that was no page, and made room", "no HTTP"

Client = tuple[str, int]


class Connections:
    """`protocol` is what the server makes for each. pages: clients that keep their place. refuse: hears a reason."""

    def __init__(self, pages: Callable[[], Collection[object]], refuse: Callable[[str], None]) -> None:
        self.pages = pages
        self.refuse = refuse
        self.transports: dict[Client, asyncio.Transport] = {}  # the oldest first
        connections = self

        class Protocol(H11Protocol):
            """HTTP, and WebSockets that begin with it."""

            def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
                super().connection_made(transport)
                connections.came(transport)

            def data_received(self, data: bytes) -> None:
                try:
                    super().data_received(data)
                except h11.ProtocolError:  # it answers what came after the last request that may be answered
                    self.transport.abort()
                    connections.refuse(NO_HTTP)

        self.protocol = Protocol

    def came(self, transport: asyncio.Transport) -> None:
        """Take it in; one that is no page may have to go."""
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
        """A page has been told to leave: it may take its time, but not for ever."""
        transport = self.transports.get(client) if client is not None else None
        if transport is not None:
            asyncio.get_running_loop().call_later(PATIENCE_S, transport.abort)


def _closed(transport: asyncio.Transport) -> bool:
    """True for one whose socket is given back."""
    return bool(transport.get_extra_info("socket").fileno() < 0)
