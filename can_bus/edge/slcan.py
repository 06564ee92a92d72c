"""An emulated bus on a pseudo-terminal, as with serial-line CAN adapters of the LAWICEL protocol.

One line per command, ended by a carriage return; the answer ends with a carriage return too, or is a bell (refused).
Understood: S and s (bit rate: acknowledged without effect, the bus keeps its own), O (open), L (open, listen only),
C (close), t T r R (send), F (status), V v N (version, serial number), Z (stamps), X M m (acknowledged, no effect). On a
CAN FD bus also d D (send CAN FD) and b B (the same with BRS), with the length code as one hexadecimal digit, and Y
(data bit rate: acknowledged without effect), as adapters with CAN FD extend the protocol. It has no sign for ESI.
"""

import dataclasses

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge.peers import FULL, Terminal
from ranger_sim.can_bus.edge.stream_server import Connection, StreamServer
from ranger_sim.can_bus.edge.taps import ERROR_PASSIVE, OFF, QUEUED, RECEIVED, Event, Taps
from ranger_sim.can_bus.fd_frame import LENGTHS
from ranger_sim.can_bus.frame import HIGHEST_EXTENDED, HIGHEST_STANDARD, LENGTH_CODE
from ranger_sim.can_bus.frame_bytes import data_of_words
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ERROR, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE

STAMP_WRAP_MS = 60_000  # LAWICEL: stamps of 16 bits run from 0 to 59999 ms
OK, BELL = b"\r", b"\a"
# letter: (digits of the identifier, flags)
FRAMES = {"t": (3, 0), "T": (8, FLAG_EXTENDED), "r": (3, FLAG_REMOTE), "R": (8, FLAG_EXTENDED | FLAG_REMOTE)}
FD_FRAMES = {
    "d": (3, FLAG_FD),
    "D": (8, FLAG_FD | FLAG_EXTENDED),
    "b": (3, FLAG_FD | FLAG_BRS),
    "B": (8, FLAG_FD | FLAG_BRS | FLAG_EXTENDED),
}
FD_LETTERS = {flags: letter for letter, (_, flags) in FD_FRAMES.items()}
LONGEST_FD_LINE = 160  # an extended frame with 64 bytes has 138 characters; chosen by us
HEXADECIMAL = frozenset("0123456789abcdefABCDEF")
# Answer to F (LAWICEL): bit 0 receive queue full, 2 warning, 3 overrun, 5 error passive, 7 bus error
STATUS_QUEUE_FULL, STATUS_PASSIVE, STATUS_BUS_ERROR = 1 << 0, 1 << 5, 1 << 7


class SlcanServer(StreamServer[Connection]):
    """One bus on one pseudo-terminal; programs open `path`. UserError where pseudo-terminals are unavailable.

    The program's node joins the bus when it opens the channel, and leaves when it closes it. Non-blocking: poll it.
    """

    def __init__(self, channel: str, bus: "Bus | Taps", epoch_ns: int = 0) -> None:
        super().__init__("slcan", None, {channel: bus}, epoch_ns)
        self.channel = channel
        self.taps = self.channels[channel]
        self.frames = FRAMES
        if self.taps.bus.is_fd:
            self.frames = {**FRAMES, **FD_FRAMES}
            self.limits = dataclasses.replace(self.limits, longest=LONGEST_FD_LINE)
        terminal = Terminal()
        self.path = terminal.path
        self.program = Connection(terminal)
        self.let_in(self.program)
        self.stamps = False
        self.overrun = False
        self.overlong = False

    def send_away(self, peer: Connection, reason: str, apology: bytes = b"") -> None:
        """Close the channel and drop its queue; the terminal remains, because the next program may be another one."""
        self.sent_away[reason] += 1
        if peer.tap is not None:
            peer.tap.flush(self.taps.time)
        self._closed(peer)
        peer.incoming.clear()
        peer.outgoing.clear()
        peer.answers = 0
        peer.wants_since_s = None

    def _take(self, peer: Connection) -> bool:
        """The next command, if its carriage return has arrived."""
        end = peer.incoming.find(b"\r")
        if end < 0:
            if len(peer.incoming) >= self.limits.longest:
                peer.incoming.clear()
                self.overlong = True
            return False
        line = bytes(peer.incoming[:end]).replace(b"\n", b"").decode("latin-1")
        del peer.incoming[: end + 1]
        if self.overlong or len(line) > self.limits.longest:
            self.overlong = False
            self._refuse()
        elif line:  # an empty line clears earlier input; it is not a command
            self._command(line)
        return True

    def _answer(self, text: bytes) -> None:
        self.program.answer(text)

    def _refuse(self) -> None:
        self.totals["malformed"] += 1
        self._answer(BELL)

    def _command(self, line: str) -> None:
        """One command and its answer."""
        letter, rest = line[0], line[1:]
        if letter in self.frames:
            self._send(letter, rest)
        elif letter in "OL" and not rest:
            if self.program.tap is not None or self.taps.full:
                self._answer(BELL)
                self.totals["refused"] += 1
                if self.program.tap is None:
                    self.sent_away[FULL] += 1
                return
            self.program.taps = self.taps
            self.program.tap = self.taps.add(f"{self.channel} slcan")
            self.totals["clients_seen"] += 1
            if letter == "L":
                self.program.tap.listen(self.taps.time)
            self._answer(OK)
        elif letter == "C" and not rest:
            self._closed(self.program)
            self._answer(OK)
        elif letter == "F" and not rest:
            self._answer(f"F{self._status():02X}".encode() + OK)
        elif letter in "Vv" and not rest:
            self._answer(f"{letter}0101".encode() + OK)
        elif letter == "N" and not rest:
            self._answer(b"NRSIM" + OK)
        elif letter == "Z" and rest in ("0", "1"):
            self.stamps = rest == "1"
            self._answer(OK)
        elif letter in "SsXMmYUQWP" and rest and all(c in HEXADECIMAL for c in rest):
            self._answer(OK)
        else:
            self._refuse()

    def _status(self) -> int:
        """The flags for F; an overrun is reported once."""
        status = STATUS_QUEUE_FULL if self.overrun else 0
        self.overrun = False
        if self.program.tap is not None:
            status |= {ERROR_PASSIVE: STATUS_PASSIVE, OFF: STATUS_BUS_ERROR}.get(self.program.tap.state, 0)
        return status

    def _send(self, letter: str, rest: str) -> None:
        """A frame: identifier, length, data."""
        digits, flags = self.frames[letter]
        name, length, data = rest[:digits], rest[digits : digits + 1], rest[digits + 1 :]
        codes = "0123456789abcdef" if flags & FLAG_FD else "012345678"
        fits = len(name) == digits and all(c in HEXADECIMAL for c in rest) and length.lower() in tuple(codes)
        code = int(length, 16) if fits else 0
        if not fits or len(data) != (0 if flags & FLAG_REMOTE else 2 * LENGTHS[code]):
            self._refuse()
            return
        identifier = int(name, 16)
        if identifier > (HIGHEST_EXTENDED if flags & FLAG_EXTENDED else HIGHEST_STANDARD):
            self._refuse()
            return
        carried = bytes.fromhex(data)
        lo, hi = int.from_bytes(carried[:4], "little"), int.from_bytes(carried[4:], "little")
        tap = self.program.tap
        if tap is None or tap.offer(identifier, flags | code, lo, hi) != QUEUED:
            self.totals["refused"] += 1
            self._answer(BELL)
            return
        self.totals["frames_in"] += 1
        self._answer((b"Z" if flags & FLAG_EXTENDED else b"z") + OK)

    def _report(self, client: Connection) -> None:
        """Send frames of the bus as lines."""
        if client.tap is not None and client.tap.events:
            events, client.tap.events = client.tap.events, []
            for event in events:
                if event[0] == RECEIVED:
                    self._show(event)

    def _show(self, event: Event) -> None:
        """A frame of the bus, as the adapter's program reads it. Error frames have no line in this protocol."""
        _, time, identifier, flags, lo, hi = event
        if flags & FLAG_ERROR:
            return
        if len(self.program.outgoing) >= self.limits.backlog:
            self.totals["frames_dropped"] += 1
            self.overrun = True
            return
        extended, remote = flags & FLAG_EXTENDED, flags & FLAG_REMOTE
        if flags & FLAG_FD:
            letter = FD_LETTERS[flags & (FLAG_FD | FLAG_BRS | FLAG_EXTENDED)]
            length = f"{flags & LENGTH_CODE:X}"
        else:
            letter = ("R" if remote else "T") if extended else ("r" if remote else "t")
            length = f"{min(flags & LENGTH_CODE, 8)}"
        text = f"{letter}{identifier:0{8 if extended else 3}X}{length}"
        if not remote:
            text += data_of_words(flags, lo, hi).hex().upper()
        if self.stamps:
            text += f"{(time + self.epoch_ns) // 1_000_000 % STAMP_WRAP_MS:04X}"
        self.program.outgoing += text.encode() + OK
        self.totals["frames_out"] += 1
