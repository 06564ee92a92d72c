"""The debugger's endpoint: a TCP port per board, one debugger at a time, under the rule of foundation/peers.py.

A debugger that connects halts the board before its next instruction. While it holds a board, the process that runs the
robot waits here, and virtual time stands still for all boards. When the debugger leaves, its points are removed and the
run goes on.
"""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from ranger_sim.firmware_sim.gdb import packets
from ranger_sim.firmware_sim.gdb.stub import SIGNAL_BAD_ACCESS, SIGNAL_INTERRUPT, SIGNAL_TRAP, Stub
from ranger_sim.firmware_sim.gdb.target import Debuggable, Target
from ranger_sim.foundation import descriptors
from ranger_sim.foundation.peers import (
    MALFORMED,
    MS,
    REASONS,
    Door,
    Peer,
    SocketStream,
    listening_address,
)
from ranger_sim.foundation.user_error import FirmwareError, UserError

# Chosen by us: how long a held process waits before it asks whether it should end (Ctrl-C at its own terminal).
WAIT_S = 0.2


class _Client(Peer):
    """A debugger."""

    def __init__(self, connection: socket.socket) -> None:
        super().__init__(SocketStream(connection))
        with suppress(OSError):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.latest = b""  # the last frame, sent again to a debugger that did not understand it


def never() -> bool:
    """No request to end this process."""
    return False


def unseen(_stands: bool) -> None:
    """Default `stands`: ignores that the process waits for a debugger."""


class GdbServer(Door[_Client]):
    """A debugger's endpoint for `board`, on `host`:`port` (0: a free port; see `port`).

    `ends` is asked while the board is held: True releases it. `stands` is called when the process begins and stops
    waiting for a debugger. UserError when the port is not available, or would be open to the network without
    `allow_network`.
    """

    def __init__(
        self,
        board: Debuggable,
        port: int,
        host: str = "127.0.0.1",
        allow_network: bool = False,
        ends: Callable[[], bool] = never,
        stands: Callable[[bool], None] = unseen,
    ) -> None:
        what = f"gdb for {board.name} on {host}:{port}"
        address = listening_address(host, what, allow_network)
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.setblocking(False)
            listener.bind((address, port))
        except (OSError, OverflowError) as error:
            listener.close()
            reason = error.strerror if isinstance(error, OSError) else "a port is 0 ... 65535"
            raise FirmwareError(f"{what}: {reason}") from None
        super().__init__("gdb", listener)
        self.host, self.port = listener.getsockname()
        self.ends = ends
        self.stands = stands
        self.client: _Client | None = None
        self.held = False
        self.seen = 0  # debuggers so far
        self.halts = 0
        self.looks = 0  # polls while the board ran
        self.doors: list[GdbServer] = [self]
        self.leads_to(board)

    # ---- for the caller that runs the board

    def begin(self) -> None:
        """Accept debuggers from now on. gdb gives up after 2 s without an answer, and tries again after a refusal: so
        the constructor takes the port, and this method opens it, when something polls it. UserError: the port cannot be
        opened."""
        assert self.listener is not None
        try:
            self.listener.listen(self.limits.peers)
        except OSError as error:
            what = f"gdb for {self.board.name} on {self.host}:{self.port}"
            raise FirmwareError(f"{what}: {error.strerror}") from None

    def leads_to(self, board: Debuggable) -> None:
        """Set the board: at first, and when a new one replaces it."""
        self.board = board
        self.target = Target(board)
        self.stub = Stub(self.target)
        self.skips_idle = bool(getattr(board, "skips_idle", False))
        board.core.debugger = self

    def together(self, doors: list[GdbServer]) -> None:
        """Poll all `doors` of this process, including this one, while one board is held."""
        self.doors = doors

    def wait_for_debugger(self) -> None:
        """Wait until a debugger has connected to each endpoint and released its board, or until `ends` returns True."""
        for door in self.doors:
            door.begin()
        with self._standing():
            while not all(door.seen for door in self.doors) and not self.ends():
                self._wait()
        self._stand()

    def close(self) -> None:
        """Release the board for good."""
        super().close()
        self.board.core.debugger = None

    # ---- what the processor calls, between two instructions

    def poll(self) -> None:
        """Check for a debugger that connects or wants to halt the board. Once per millisecond of the board
        (Core.LOOK_CYCLES)."""
        self.looks += 1
        self._attend(self.looks * MS)
        self._stand()

    def halted(self, error: UserError | None) -> None:
        """Halt at a point or after a step, or (`error`) because the program did something illegal."""
        if self.client is None:
            return
        if error is not None:
            self._say(f"{error}\n")
        self._halt(SIGNAL_TRAP if error is None else SIGNAL_BAD_ACCESS)
        self._stand()

    def _halt(self, signal: int) -> None:
        """Give control of the board to the debugger."""
        self.held = True
        self.halts += 1
        reply = self.stub.stopped(signal, self.board.core.hit)
        if self.client is not None:
            self._reply(self.client, reply)

    def _stand(self) -> None:
        """Wait until no board of this process is held."""
        if not any(door.held for door in self.doors):
            return
        with self._standing():
            while any(door.held for door in self.doors):
                if self.ends():
                    for door in self.doors:
                        door._let_go()
                    return
                self._wait()

    @contextmanager
    def _standing(self) -> Iterator[None]:
        """Context in which the process waits for a debugger."""
        self.stands(True)
        try:
            yield
        finally:
            self.stands(False)

    # ---- polling the endpoint

    def _attend(self, now_ns: int = 0) -> None:
        """Carry out received requests, as far as buffers allow, and send answers; 0: the board is halted."""
        self.look(now_ns)
        self.write()

    def _wait(self) -> None:
        """Wait until an endpoint has work, at most WAIT_S, and do it."""
        to_read, to_write = [], []
        for door in self.doors:
            door.write()
            to_read += door.filenos()
            to_write += door.filenos_to_write()
        if not any(door.left_over for door in self.doors):
            descriptors.wait(to_read, to_write, WAIT_S)
        for door in self.doors:
            door._attend()

    def _welcome(self, connection: socket.socket) -> _Client:
        return _Client(connection)

    def let_in(self, peer: _Client) -> None:
        """Give the board to the first debugger; it asks by itself why the board has halted."""
        super().let_in(peer)
        if self.client is None:
            self.client = peer
            self.stub.begin()
            self.seen += 1
            self.held = True

    def _takes_part(self, peer: _Client) -> bool:
        return True

    def _apology(self, reason: str) -> bytes:
        return packets.framed(b"E.this debugger " + REASONS[reason].encode())

    def _closed(self, peer: _Client) -> None:
        if peer is self.client:
            self.client = None
            self._let_go()

    def _let_go(self) -> None:
        """Remove points and step; the board runs on."""
        self.target.clear_points()
        self.board.core.stepping = 0
        self.board.core.rearm()
        self._skip_idle()
        self.held = False

    def _skip_idle(self) -> None:
        """Disable the skipping of wait loops while points are set in them."""
        if self.skips_idle:
            self.board.skips_idle = not self.board.core.armed  # type: ignore[attr-defined]

    # ---- frames

    def _take(self, peer: _Client) -> bool:
        """Take one frame, or the interrupt byte."""
        incoming = peer.incoming
        del incoming[: len(incoming) - len(incoming.lstrip(b"+"))]
        if not incoming:
            return False
        first = incoming[0]
        if first == packets.INTERRUPT:
            del incoming[0]
            if not self.held:
                self._halt(SIGNAL_INTERRUPT)
            return True
        if first == ord("-"):
            del incoming[0]
            peer.answer(peer.latest)
            return True
        try:
            if first != ord("$"):
                raise packets.MalformedError
            frame = packets.take_frame(incoming)
        except packets.MalformedError:
            self.send_away(peer, MALFORMED)
            return False
        if frame is None:
            return False
        payload, is_right = frame
        if not is_right:
            peer.answer(b"-")
            return True
        if self.stub.acknowledged:
            peer.answer(b"+")
        self._carry_out(peer, payload)
        return True

    def _carry_out(self, peer: _Client, payload: bytes) -> None:
        """Carry out a request. While the board runs, every request except leaving is answered by an error."""
        if not self.held and payload[:1] not in (b"D", b"k"):
            self._reply(peer, b"E10")  # EBUSY
            return
        reply = self.stub.answer(payload)
        if self.stub.console:
            self._say(self.stub.console)
            self.stub.console = ""
        if reply is not None:
            self._reply(peer, reply)
        self._skip_idle()
        if self.stub.resumes:
            self.stub.resumes = False
            self.held = False
        if self.stub.leaves:
            self.stub.leaves = False
            self._write(peer)
            self.drop(peer)

    def _reply(self, peer: _Client, payload: bytes) -> None:
        peer.latest = packets.framed(payload)
        peer.answer(peer.latest)

    def _say(self, text: str) -> None:
        """Print lines on the debugger's console; the protocol allows this before a stop reply and before the answer of
        `monitor`."""
        if self.client is not None:
            self.client.answer(packets.framed(b"O" + text.encode().hex().encode()))
