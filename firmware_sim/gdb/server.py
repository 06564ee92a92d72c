"""Where a debugger comes in: a TCP port per board, one debugger at a time, under the rule of foundation/peers.py.

A debugger that connects halts the board before its next instruction. While it holds a board, the process that runs the
robot waits here: no virtual time passes for anybody. When it leaves, its points go with it and the run goes on.
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
from ranger_sim.foundation.user_error import UserError

# Chosen by us: so long a held process waits before it asks whether it is to end (Ctrl-C at its own terminal).
WAIT_S = 0.2


class _Client(Peer):
    """A debugger."""

    def __init__(self, connection: socket.socket) -> None:
        super().__init__(SocketStream(connection))
        with suppress(OSError):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.latest = b""  # frame, for a debugger that has not understood it


def never() -> bool:
    """Nobody asks this process to end."""
    return False


def unseen(_stands: bool) -> None:
    """Nobody wants to know that the process waits for a debugger."""


class GdbServer(Door[_Client]):
    """A debugger's door to `board`, on `host`:`port` (0: a free one; see `port`).

    `ends` is asked while the board is held: True lets it go. `stands` is told when the process begins and ends to wait
    for a debugger. UserError when the port cannot be had, or would be open to the network without `allow_network`.
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
            raise UserError(f"{what}: {reason}") from None
        super().__init__("gdb", listener)
        self.host, self.port = listener.getsockname()
        self.ends = ends
        self.stands = stands
        self.client: _Client | None = None
        self.held = False
        self.seen = 0  # debuggers so far
        self.halts = 0
        self.looks = 0  # while it ran
        self.doors: list[GdbServer] = [self]
        self.leads_to(board)

    # ---- for whoever runs the board

    def begin(self) -> None:
        """From now on debuggers are heard. gdb gives up after 2 s without an answer, and tries again what is refused:
        so the port is taken when the door is made, and opened when somebody looks at it. UserError: it cannot be."""
        assert self.listener is not None
        try:
            self.listener.listen(self.limits.peers)
        except OSError as error:
            what = f"gdb for {self.board.name} on {self.host}:{self.port}"
            raise UserError(f"{what}: {error.strerror}") from None

    def leads_to(self, board: Debuggable) -> None:
        """From now on this is the board: at first, and when a new one takes its place."""
        self.board = board
        self.target = Target(board)
        self.stub = Stub(self.target)
        self.skips_idle = bool(getattr(board, "skips_idle", False))
        board.core.debugger = self

    def together(self, doors: list[GdbServer]) -> None:
        """The doors of one process, this one among them: while one board is held, all are looked at."""
        self.doors = doors

    def wait_for_debugger(self) -> None:
        """Wait until one has come to each of the doors and let its board go, or until `ends` says so."""
        for door in self.doors:
            door.begin()
        with self._standing():
            while not all(door.seen for door in self.doors) and not self.ends():
                self._wait()
        self._stand()

    def close(self) -> None:
        """The board is left alone from now on."""
        super().close()
        self.board.core.debugger = None

    # ---- what the processor calls, between two instructions

    def poll(self) -> None:
        """Somebody may have come, or wants the board halted. Once in a millisecond of the board (Core.LOOK_CYCLES)."""
        self.looks += 1
        self._attend(self.looks * MS)
        self._stand()

    def halted(self, error: UserError | None) -> None:
        """A point or a step has been reached, or (`error`) the program did what it may not."""
        if self.client is None:
            return
        if error is not None:
            self._say(f"{error}\n")
        self._halt(SIGNAL_TRAP if error is None else SIGNAL_BAD_ACCESS)
        self._stand()

    def _halt(self, signal: int) -> None:
        """The board is the debugger's from now on."""
        self.held = True
        self.halts += 1
        reply = self.stub.stopped(signal, self.board.core.hit)
        if self.client is not None:
            self._reply(self.client, reply)

    def _stand(self) -> None:
        """Nothing runs until no board of this process is held any more."""
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
        """Inside, the process waits for a debugger."""
        self.stands(True)
        try:
            yield
        finally:
            self.stands(False)

    # ---- a look at the door

    def _attend(self, now_ns: int = 0) -> None:
        """What has come is carried out, as far as there is room, and answers go out; 0: the board stands."""
        self.look(now_ns)
        self.write()

    def _wait(self) -> None:
        """Until a door has something to do, at most WAIT_S; then it is done."""
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
        """The first one has the board from now on; it asks by itself why that stands."""
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
        """No points, no step; the board runs on."""
        self.target.clear_points()
        self.board.core.stepping = 0
        self.board.core.rearm()
        self._skip_idle()
        self.held = False

    def _skip_idle(self) -> None:
        """A board that skips loops that wait does not while there are points in them."""
        if self.skips_idle:
            self.board.skips_idle = not self.board.core.armed  # type: ignore[attr-defined]

    # ---- frames

    def _take(self, peer: _Client) -> bool:
        """One frame, or the interrupt byte."""
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
        """A request. One that comes while the board runs is answered by an error, except leaving."""
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
        """Lines on the debugger's console; the protocol has that before a stop reply and the answer of `monitor`."""
        if self.client is not None:
            self.client.answer(packets.framed(b"O" + text.encode().hex().encode()))
