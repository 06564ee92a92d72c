"""An emulated bus behind a pseudo-terminal, as the serial-line CAN adapters of the LAWICEL protocol show theirs.

One line per command, ended by a carriage return; the answer ends with a carriage return too, or is a bell (refused).
Understood: S and s (bit rate: acknowledged without effect, the bus keeps its own), O (open), L (open, listen only),
C (close), t T r R (send), F (status), V v N (version, serial number), Z (stamps), X M m (acknowledged, no effect).
"""

import math
import os
import sys
from contextlib import suppress

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge.messages import data_of_words, words_of_data
from ranger_sim.can_bus.edge.stream_server import COUNTERS, NEXT_POLL_NS, QUICK_POLL_NS
from ranger_sim.can_bus.edge.taps import ERROR_PASSIVE, OFF, QUEUED, RECEIVED, Event, Tap, Taps, taps_of
from ranger_sim.can_bus.frame import HIGHEST_EXTENDED, HIGHEST_STANDARD, LENGTH_CODE
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.foundation.user_error import UserError

LINE_LIMIT = 32  # characters; the longest command, an extended frame of eight bytes, has 26
BACKLOG_LIMIT = 1 << 16  # bytes that wait for a slow reader before frames are dropped; chosen by us
HELD_ABOVE = 1 << 12  # bytes; a bus at full speed waits then
STAMP_WRAP_MS = 60_000  # LAWICEL: stamps of 16 bits run from 0 to 59999 ms
OK, BELL = b"\r", b"\a"
# letter: (digits of the identifier, flags)
FRAMES = {"t": (3, 0), "T": (8, FLAG_EXTENDED), "r": (3, FLAG_REMOTE), "R": (8, FLAG_EXTENDED | FLAG_REMOTE)}
HEXADECIMAL = frozenset("0123456789abcdefABCDEF")
# What F answers (LAWICEL): bit 0 receive queue full, 2 warning, 3 overrun, 5 error passive, 7 bus error
STATUS_QUEUE_FULL, STATUS_PASSIVE, STATUS_BUS_ERROR = 1 << 0, 1 << 5, 1 << 7


class SlcanServer:
    """One bus on one pseudo-terminal; `path` is what a program opens. UserError where there are none.

    The program's node joins the bus when it opens the channel, and leaves when it closes it. Non-blocking: poll it.
    """

    def __init__(self, channel: str, bus: "Bus | Taps", epoch_ns: int = 0) -> None:
        self.channel = channel
        self.epoch_ns = epoch_ns
        self.taps, self.own = taps_of(bus)
        self.tap: Tap | None = None
        self.incoming = bytearray()
        self.outgoing = bytearray()
        self.stamps = False
        self.overrun = False
        self.overlong = False
        self.totals = dict.fromkeys(COUNTERS, 0)
        try:
            import tty
        except ImportError:
            raise UserError(f"slcan: there are no pseudo-terminals on {sys.platform}") from None
        # our own hand stays on the program's end too: reading then never fails between two programs
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        self.path = os.ttyname(self.slave)

    def poll(self, now_ns: int) -> int:
        """Commands in, answers and frames out; returns the latest instant for the next poll, ns."""
        with suppress(BlockingIOError):
            while data := os.read(self.master, 4096):
                self._understand(data)
                if len(data) < 4096:
                    break
        if self.own:
            self.taps.poll(now_ns)
        if self.tap is not None and self.tap.events:
            events, self.tap.events = self.tap.events, []
            for event in events:
                if event[0] == RECEIVED:
                    self._show(event)
        if self.outgoing:
            with suppress(BlockingIOError):
                sent = os.write(self.master, self.outgoing[:4096])
                del self.outgoing[:sent]
        if self.tap is not None:
            self.tap.held = len(self.outgoing) > HELD_ABOVE
        return now_ns + (QUICK_POLL_NS if self.tap is not None and self.tap.queued else NEXT_POLL_NS)

    def filenos(self) -> list[int]:
        """Descriptors that become readable when the program wants something."""
        return [self.master]

    def filenos_to_write(self) -> list[int]:
        """Descriptors on which something waits until the program takes more."""
        return [self.master] if self.outgoing else []

    def patience_s(self) -> float:
        """Wall-clock seconds after which a poll has something to do even if nothing else happens."""
        return math.inf

    def counters(self) -> dict[str, int]:
        """Whole numbers by name: clients now, clients seen, frames in, out and dropped, malformed, refused."""
        return {"clients": int(self.tap is not None), **self.totals}

    def close(self) -> None:
        """Leave the bus; the pseudo-terminal is gone."""
        self._close_channel()
        os.close(self.master)
        os.close(self.slave)

    def _understand(self, data: bytes) -> None:
        """Bytes of the program; every carriage return ends a command."""
        for byte in data:
            if byte == 0x0D:
                line = self.incoming.decode("latin-1")
                self.incoming.clear()
                if self.overlong:
                    self.overlong = False
                    self._refuse()
                elif line:  # an empty line clears what came before; it is no command
                    self._command(line)
            elif byte != 0x0A and not self.overlong:
                self.incoming.append(byte)
                if len(self.incoming) > LINE_LIMIT:
                    self.incoming.clear()
                    self.overlong = True

    def _refuse(self) -> None:
        self.totals["malformed"] += 1
        self.outgoing += BELL

    def _command(self, line: str) -> None:
        """One command and its answer."""
        letter, rest = line[0], line[1:]
        if letter in FRAMES:
            self._send(letter, rest)
        elif letter in "OL" and not rest:
            if self.tap is not None:
                self.outgoing += BELL
                self.totals["refused"] += 1
                return
            self.tap = self.taps.add(f"{self.channel} slcan")
            self.totals["clients_seen"] += 1
            if letter == "L":
                self.tap.listen(self.taps.time)
            self.outgoing += OK
        elif letter == "C" and not rest:
            self._close_channel()
            self.outgoing += OK
        elif letter == "F" and not rest:
            self.outgoing += f"F{self._status():02X}".encode() + OK
        elif letter in "Vv" and not rest:
            self.outgoing += f"{letter}0101".encode() + OK
        elif letter == "N" and not rest:
            self.outgoing += b"NRSIM" + OK
        elif letter == "Z" and rest in ("0", "1"):
            self.stamps = rest == "1"
            self.outgoing += OK
        elif letter in "SsXMmYUQWP" and rest and all(c in HEXADECIMAL for c in rest):
            self.outgoing += OK
        else:
            self._refuse()

    def _close_channel(self) -> None:
        if self.tap is not None:
            self.tap.held = False
            self.taps.remove(self.tap)
            self.tap = None

    def _status(self) -> int:
        """The flags that F asks for; an overrun is told once."""
        status = STATUS_QUEUE_FULL if self.overrun else 0
        self.overrun = False
        if self.tap is not None:
            status |= {ERROR_PASSIVE: STATUS_PASSIVE, OFF: STATUS_BUS_ERROR}.get(self.tap.state, 0)
        return status

    def _send(self, letter: str, rest: str) -> None:
        """t, T, r or R: identifier, length, data."""
        digits, flags = FRAMES[letter]
        name, length, data = rest[:digits], rest[digits : digits + 1], rest[digits + 1 :]
        fits = len(name) == digits and all(c in HEXADECIMAL for c in rest) and length in tuple("012345678")
        if not fits or len(data) != (0 if flags & FLAG_REMOTE else 2 * int(length)):
            self._refuse()
            return
        identifier = int(name, 16)
        if identifier > (HIGHEST_EXTENDED if flags & FLAG_EXTENDED else HIGHEST_STANDARD):
            self._refuse()
            return
        lo, hi = words_of_data(bytes.fromhex(data))
        if self.tap is None or self.tap.offer(identifier, flags | int(length), lo, hi) != QUEUED:
            self.totals["refused"] += 1
            self.outgoing += BELL
            return
        self.totals["frames_in"] += 1
        self.outgoing += (b"Z" if flags & FLAG_EXTENDED else b"z") + OK

    def _show(self, event: Event) -> None:
        """A frame of the bus, as the adapter's program reads it. Error frames have no line in this protocol."""
        _, time, identifier, flags, lo, hi = event
        if flags & FLAG_ERROR:
            return
        if len(self.outgoing) >= BACKLOG_LIMIT:
            self.totals["frames_dropped"] += 1
            self.overrun = True
            return
        extended, remote = flags & FLAG_EXTENDED, flags & FLAG_REMOTE
        letter = ("R" if remote else "T") if extended else ("r" if remote else "t")
        text = f"{letter}{identifier:0{8 if extended else 3}X}{min(flags & LENGTH_CODE, 8)}"
        if not remote:
            text += data_of_words(flags, lo, hi).hex().upper()
        if self.stamps:
            text += f"{(time + self.epoch_ns) // 1_000_000 % STAMP_WRAP_MS:04X}"
        self.outgoing += text.encode() + OK
        self.totals["frames_out"] += 1
