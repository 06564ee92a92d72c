"""Emulated buses over TCP in the raw mode of the socketcand protocol, which several CAN programs use.

`< open can1 >`, `< rawmode >`, then `< send 123 2 11 22 >` in and `< frame 123 1.000000 1122 >` out. Remote frames
and CAN FD frames have no text in that mode (they are counted as not carried). On loopback this user's programs and
root's are served, and all users' where the system does not report owners (Windows, macOS); beyond it, where it must be
allowed, all are.
"""

import socket
from collections.abc import Mapping
from contextlib import suppress

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge.peers import FULL, LIMITS, MALFORMED, REASONS, SocketStream, listening_address
from ranger_sim.can_bus.edge.stream_server import Connection, StreamServer
from ranger_sim.can_bus.edge.taps import QUEUED, RECEIVED, Event, Tap, Taps
from ranger_sim.can_bus.frame import HIGHEST_EXTENDED, HIGHEST_STANDARD
from ranger_sim.can_bus.frame_bytes import data_of_words, words_of_data
from ranger_sim.foundation import systems
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE
from ranger_sim.foundation.user_error import BusError

# Clients read everything that has arrived as the answer to `rawmode`; a frame directly after it confuses them. So
# nothing follows it for this long (chosen by us: the time in which a client reads its answer on a busy machine).
QUIET_AFTER_RAWMODE_S = 0.1
KEPT_LIMIT = 4096  # events kept meanwhile; chosen by us: 0.1 s of a full bus are 2,700 frames
ERROR_MASK = 0x1FFFFFFF


class _Client(Connection):
    """One connection."""

    def __init__(self, connection: socket.socket) -> None:
        super().__init__(SocketStream(connection))
        with suppress(OSError):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.answer(b"< hi >")
        self.quiet_until = 0.0
        self.kept: list[Event] = []


class SocketcandServer(StreamServer[_Client]):
    """`buses`, {channel: Bus}, on a TCP port (0: a free one; see `port`).

    UserError when the port is unavailable, or when it would be open to the network without `allow_network`.
    """

    def __init__(
        self,
        buses: "Mapping[str, Bus | Taps]",
        port: int,
        host: str = "127.0.0.1",
        epoch_ns: int = 0,
        allow_network: bool = False,
    ) -> None:
        address = listening_address(host, f"socketcand on {host}:{port}", allow_network)
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            if not systems.is_windows():  # there it would let another server take the port away
                listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.setblocking(False)
            listener.bind((address, port))
            listener.listen(LIMITS["socketcand"].peers)
        except (OSError, OverflowError) as error:
            listener.close()
            reason = error.strerror if isinstance(error, OSError) else "a port is 0 ... 65535"
            raise BusError(f"socketcand on {host}:{port}: {reason}") from None
        super().__init__("socketcand", listener, buses, epoch_ns)
        self.totals["not_carried"] = 0
        self.texts: dict[Event, bytes] = {}  # frames of this poll as text for all clients
        self.host, self.port = listener.getsockname()

    def deliver(self) -> None:
        """As in every server; each frame is formatted once for all clients."""
        self.texts.clear()
        super().deliver()

    def patience_s(self) -> float:
        """Time until kept frames may follow the answer to rawmode."""
        patience = super().patience_s()
        return min(patience, QUIET_AFTER_RAWMODE_S) if any(client.kept for client in self.peers) else patience

    def _welcome(self, connection: socket.socket) -> _Client:
        return _Client(connection)

    def _last_bytes(self, reason: str) -> bytes:
        return f"< error this client {REASONS[reason]} >".encode()

    def _take(self, client: _Client) -> bool:
        """The next message, if its closing bracket has arrived."""
        incoming = client.incoming
        del incoming[: len(incoming) - len(incoming.lstrip())]
        end = incoming.find(b">")
        text = bytes(incoming[1 : end if end >= 0 else None])
        if incoming and (not incoming.startswith(b"<") or b"<" in text):
            self.totals["malformed"] += 1
            self.send_away(client, MALFORMED, b"< error that is no message in angle brackets >")
            return False
        if end < 0:
            return False
        del incoming[: end + 1]
        self._command(client, text.decode("latin-1").split())
        return True

    def _refuse(self, client: _Client, reason: str) -> None:
        self.totals["malformed"] += 1
        client.answer(f"< error {reason} >".encode())

    def _command(self, client: _Client, words: list[str]) -> None:
        """One message and its answer."""
        order = words[0] if words else ""
        if order == "open" and len(words) == 2 and client.taps is None:
            client.taps = self.channels.get(words[1])
            if client.taps is None:
                self.totals["refused"] += 1
                refusal = f"< error could not open bus (available: {' '.join(self.channels)}) >"
                self.send_away(client, MALFORMED, refusal.encode())
                return
            client.answer(b"< ok >")
        elif order == "rawmode" and len(words) == 1 and client.taps is not None and client.tap is None:
            if client.taps.full:
                self.send_away(client, FULL)
                return
            client.tap = client.taps.add("socketcand client")
            client.quiet_until = self.clock() + QUIET_AFTER_RAWMODE_S
            self.totals["clients_seen"] += 1
            client.answer(b"< ok >")
        elif order == "echo" and len(words) == 1:
            client.answer(b"< echo >")
        elif order == "send" and client.tap is not None:
            self._send(client, client.tap, words[1:])
        else:
            self._refuse(client, f"{order[:20] or 'an empty message'} is not understood here")

    def _send(self, client: _Client, tap: Tap, words: list[str]) -> None:
        """send: identifier (three or eight digits), length, bytes, all hexadecimal."""
        try:
            identifier, length = int(words[0], 16), int(words[1], 16)
            data = bytes(int(word, 16) for word in words[2:])
        except (ValueError, IndexError):
            self._refuse(client, "a send is: identifier length bytes, in hexadecimal")
            return
        extended = len(words[0]) > 3
        if (
            not 0 <= identifier <= (HIGHEST_EXTENDED if extended else HIGHEST_STANDARD)
            or length > 8
            or length != len(data)
        ):
            self._refuse(client, "a send of an impossible identifier or length")
            return
        lo, hi = words_of_data(data)
        if tap.offer(identifier, length | (FLAG_EXTENDED if extended else 0), lo, hi) == QUEUED:
            self.totals["frames_in"] += 1
        else:  # the protocol has no message for a full queue
            self.totals["refused"] += 1

    def _report(self, client: _Client) -> None:
        """Send frames of the bus as text."""
        if client.tap is None or not client.tap.events and not client.kept:
            return
        events, client.tap.events = client.tap.events, []
        if client.quiet_until:
            if self.clock() < client.quiet_until:
                room = KEPT_LIMIT - len(client.kept)
                client.kept += events[:room]
                self.totals["frames_dropped"] += max(0, len(events) - room)
                return
            client.quiet_until = 0.0
            events = client.kept + events
            client.kept = []
        texts, out, totals = self.texts, client.outgoing, self.totals
        for event in events:
            if event[0] != RECEIVED:
                continue
            if event[3] & (FLAG_REMOTE | FLAG_FD):
                totals["not_carried"] += 1
                continue
            if len(out) >= self.limits.backlog:
                totals["frames_dropped"] += 1
                continue
            text = texts.get(event)
            if text is None:
                text = texts[event] = self._text_of(event)
            out += text
            totals["frames_out"] += 1

    def _text_of(self, event: Event) -> bytes:
        """A frame of the bus in the protocol's format."""
        _, time, identifier, flags, lo, hi = event
        seconds, rest = divmod(time + self.epoch_ns, 1_000_000_000)
        stamp = f"{seconds}.{rest // 1000:06d}"
        if flags & FLAG_ERROR:
            return f"< error {identifier & ERROR_MASK:03X} {stamp} >".encode()
        name = f"{identifier:08X}" if flags & FLAG_EXTENDED else f"{identifier:03X}"
        return f"< frame {name} {stamp} {data_of_words(flags, lo, hi).hex().upper()} >".encode()
