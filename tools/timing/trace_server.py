"""Serve one trace over HTTP to Perfetto's viewer in a browser of this machine; `can_bus/edge/peers.py` has the rule.

The server answers one request per connection and closes it. Only the viewer's page may read the trace: the Origin and
Host that a browser sends must be the viewer and this machine, so that a page of another site, even one whose name
resolves to this machine, receives nothing.
"""

import pathlib
import socket
from typing import BinaryIO
from urllib.parse import unquote

from ranger_sim.can_bus.edge.peers import ARRIVALS_PER_S, FULL, LIMITS, REASONS, Peer, PeerServer, SocketStream
from ranger_sim.foundation import descriptors

VIEWER = "https://ui.perfetto.dev"
# The only port from which Perfetto's viewer may read: its Content-Security-Policy names trace_processor's port.
PORT = 9001
HERE = "127.0.0.1"
# The viewer fetches a long trace in pieces and processes each before it requests the next; chosen by us.
TOLERATED_S = 60.0
END_OF_HEAD = b"\r\n\r\n"  # RFC 9112, section 2.1
OK, NO_CONTENT, BAD_REQUEST, FORBIDDEN, NOT_FOUND, NOT_ALLOWED, UNAVAILABLE = (
    "200 OK",
    "204 No Content",
    "400 Bad Request",
    "403 Forbidden",
    "404 Not Found",
    "405 Method Not Allowed",
    "503 Service Unavailable",
)  # RFC 9110, section 15


class Visitor(Peer):
    """One connection; with `body`, `left` bytes of the file still follow the bytes in `outgoing`."""

    def __init__(self, connection: socket.socket) -> None:
        super().__init__(SocketStream(connection))
        self.body: BinaryIO | None = None
        self.left = 0

    def write(self, limit: int) -> None:
        """Write as any peer; read the next piece of the file when the previous one is sent."""
        super().write(limit)
        if self.body is not None and not self.outgoing:
            piece = self.body.read(min(limit, self.left))
            self.left -= len(piece)
            self.answer(piece)  # none: the file has become shorter, and the connection ends early


class TraceServer(PeerServer[Visitor]):
    """Serves one file on loopback; `served`: a client has read all of it. OSError if the port is not available."""

    tolerated_s = TOLERATED_S

    def __init__(self, file: pathlib.Path, port: int = PORT) -> None:
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.setblocking(False)
            listener.bind((HERE, port))
            listener.listen(LIMITS["trace"].peers)
        except OSError:
            listener.close()
            raise
        super().__init__("trace", listener)
        self.file = file
        self.served = False
        self.port = int(listener.getsockname()[1])

    def turn(self, patience_s: float) -> None:
        """Wait for an event and handle it."""
        if self.left_over:
            patience_s = 0.0
        elif self.connections_wait:
            patience_s = min(patience_s, 1.0 / ARRIVALS_PER_S)
        descriptors.wait(self.filenos(), self.filenos_to_write(), patience_s)
        self.receive(0)
        self.write()

    def _welcome(self, connection: socket.socket) -> Visitor:
        return Visitor(connection)

    def _takes_part(self, peer: Visitor) -> bool:
        """A client whose answer is being sent keeps its place."""
        return peer.ending

    def _last_bytes(self, reason: str) -> bytes:
        return _head(UNAVAILABLE if reason == FULL else BAD_REQUEST, {"Warning": f'199 - "{REASONS[reason]}"'})

    def _take(self, peer: Visitor) -> bool:
        """Handle the request if its head is complete; its body is not read."""
        end = peer.incoming.find(END_OF_HEAD)
        if end < 0:
            return False
        lines = bytes(peer.incoming[:end]).decode("latin-1").split("\r\n")
        peer.incoming.clear()
        peer.ending = True  # closed when the answer is sent
        fields = {name.strip().lower(): value.strip() for name, _, value in (line.partition(":") for line in lines[1:])}
        method, _, rest = lines[0].partition(" ")
        target, _, version = rest.rpartition(" ")
        if not version.startswith("HTTP/1."):
            peer.answer(_head(BAD_REQUEST))
        elif fields.get("origin", VIEWER) != VIEWER or not self._is_here(fields.get("host", "")):
            peer.answer(_head(FORBIDDEN))
        elif method == "OPTIONS":  # a browser asks if a page of the internet may send requests: it may GET
            peer.answer(_head(NO_CONTENT, {"Access-Control-Allow-Methods": "GET"}))
        elif method != "GET":
            peer.answer(_head(NOT_ALLOWED, {"Allow": "GET, OPTIONS"}))
        elif unquote(target) != f"/{self.file.name}":
            peer.answer(_head(NOT_FOUND))
        else:
            self._show(peer)
        return True

    def _is_here(self, host: str) -> bool:
        """True for this machine's names in a browser; "" is a program that sent no Host."""
        return host in ("", f"{HERE}:{self.port}", f"localhost:{self.port}")

    def _show(self, peer: Visitor) -> None:
        """Send the file, at its present length."""
        try:
            peer.body = self.file.open("rb")
            peer.left = self.file.stat().st_size
        except OSError:
            peer.answer(_head(NOT_FOUND))
            return
        peer.answer(_head(OK, {"Content-Type": "application/octet-stream"}, peer.left))

    def drop(self, peer: Visitor) -> None:
        """Close; the file was served if everything was sent."""
        if peer.body is not None:
            peer.body.close()
            peer.body = None
            self.served = self.served or peer.left == 0 and not peer.outgoing
        super().drop(peer)


def _head(status: str, fields: dict[str, str] | None = None, length: int = 0) -> bytes:
    """The head of an answer; each allows only Perfetto's viewer to read it, even from a page of the internet."""
    headers = {
        "Access-Control-Allow-Origin": VIEWER,
        "Access-Control-Allow-Private-Network": "true",
        "Cache-Control": "no-cache",
        "Connection": "close",
        "Content-Length": str(length),
        **(fields or {}),
    }
    if status == NO_CONTENT:
        del headers["Content-Length"]  # RFC 9110, section 8.6
    return "\r\n".join(
        [f"HTTP/1.1 {status}", *(f"{name}: {value}" for name, value in headers.items()), "", ""]
    ).encode()
