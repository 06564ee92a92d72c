"""One session with a robot: received values, pending requests, unanswered writes.

Pass received bytes to `receive`, send the bytes from `outgoing`; the caller supplies the time, in s. So the same
session works on a port with the wall clock, and in a test on virtual time.
"""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Callable, Iterable

from ranger_sim.boards.main_brain.data_link import CHANNELS, FAST, MEDIUM
from ranger_sim.datatable import parameters
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.model import Variable
from ranger_sim.datatable.packing import parts_of_error_word, word_of_value
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.robodaq import catalogue
from ranger_sim.tools.robodaq.codec import Point, SegmentDecoder, write_packet

TIMESTAMP = all_variables.ID_OF["TIMESTAMP"]
ERRORS = all_variables.ID_OF["ERROR_LABVIEW"]
FIRST_CHANNEL = all_variables.ID_OF["LV_CH_0"]
# The session itself uses two channels: the robot's time reveals gaps, and errors are sent as soon as they occur.
OWN = (TIMESTAMP + MEDIUM, ERRORS + FAST)
GAP_MS = 50  # the logs of the real robot have radio gaps of 50 ms and more (robot.md C6.1)
# The robot takes 499 bytes in 22 ms and answers by its slow list, in about a third of a second at full speed.
UNANSWERED_MAX = 40  # packets of 8 bytes under way at a time: 320 bytes
REPEAT_S = 2.0  # a packet not confirmed within this time may have been lost: it is sent again (chosen by us)
HALF = 1 << 31


@dataclasses.dataclass
class ErrorLine:
    """One error of one board: its count, and the robot's time (ms) of the last one."""

    board: str
    code: int
    name: str
    text: str
    count: int = 0
    stamp: int = 0


@dataclasses.dataclass
class _Write:
    """A packet to send until its value is received back."""

    number: int
    word: int
    sent_s: float | None = None
    times: int = 0


class Session:
    """`points` is called with every point; `errors` is {(board, code): ErrorLine}, the latest at the end.

    `values`: {identifier: (word, stamp)} of the last point; `counts`: number of points of each.
    """

    def __init__(self, on_point: Callable[[Point], None] | None = None) -> None:
        self.on_point = on_point
        self.decoder = SegmentDecoder(all_variables.ID_OF_LAST)
        self.values: dict[int, tuple[int, int]] = {}
        self.counts: collections.Counter[int] = collections.Counter()
        self.points = 0
        self.bytes_in = 0
        self.last_byte_s: float | None = None
        self.clock_ms: int | None = None  # the newest stamp
        self.gaps = 0
        self.longest_gap_ms = 0
        self.restarts = 0
        self.errors: dict[tuple[int, int], ErrorLine] = {}
        self.new_errors: collections.deque[tuple[ErrorLine, int]] = collections.deque()
        self._last_error: tuple[int, int] | None = None
        self.selection: tuple[int, ...] = ()  # words wanted in the channels, as numbers
        self.writes: dict[int, _Write] = {}  # by identifier, in the order of the requests
        self.reads: set[int] = set()
        self.sent_packets = 0

    # --- requests ---------------------------------------------------------------------------------------

    def select(self, fast: Iterable[Variable], medium: Iterable[Variable]) -> None:
        """Make the robot send these more often than the rest; UserError if the channels do not suffice."""
        own = {TIMESTAMP, ERRORS}
        often = dict.fromkeys(row.id for row in fast if row.id not in own)
        rarer = dict.fromkeys(row.id for row in medium if row.id not in own and row.id not in often)
        wanted = [*OWN, *(number + FAST for number in often), *(number + MEDIUM for number in rarer)]
        if len(wanted) > CHANNELS:
            raise UserError(
                f"{len(wanted) - len(OWN)} channels chosen; the link has {CHANNELS}, "
                f"{len(OWN)} of them for time and errors"
            )
        self.selection = (*wanted, *(0 for _ in range(CHANNELS - len(wanted))))
        self._write_selection()

    def _write_selection(self) -> None:
        for place, value in enumerate(self.selection):
            self._want(FIRST_CHANNEL + place, word_of_value("f32", value))

    def write(self, name: str, value: float, place: str = "") -> None:
        """Set a parameter; UserError for anything but a parameter, or a value outside its limits."""
        row = parameters.parameter(name)
        self._want(row.id, parameters.checked_word(row, value, place))

    def _want(self, number: int, word: int) -> None:
        self.writes.pop(number, None)
        self.writes[number] = _Write(number, word)
        self.reads.discard(number)

    def read(self, name: str) -> None:
        """Wait for a new value of a variable."""
        self.reads.add(parameters.find(name).id)

    def pending(self) -> list[str]:
        """Names that were written or requested and not answered yet; channels count as one."""
        names = [all_variables.NAMES[n] for n in (*self.writes, *self.reads)]
        return list(dict.fromkeys("channels" if name.startswith("LV_CH_") else name for name in names))

    # --- bytes ------------------------------------------------------------------------------------------

    def outgoing(self, now_s: float) -> bytes:
        """The bytes to send now; call it again as time passes."""
        due = []
        under_way = 0
        for write in self.writes.values():
            if write.sent_s is not None and now_s - write.sent_s < REPEAT_S:
                under_way += 1
            else:
                due.append(write)
        out = b""
        for write in due[: max(0, UNANSWERED_MAX - under_way)]:
            write.sent_s = now_s
            write.times += 1
            self.sent_packets += 1
            out += write_packet(write.number, write.word)
        return out

    def receive(self, data: bytes, now_s: float) -> int:
        """Process bytes from the robot; returns the number of points in them."""
        if data:
            self.bytes_in += len(data)
            self.last_byte_s = now_s
        points = self.decoder.feed(data)
        for point in points:
            self._take(point)
        return len(points)

    def _take(self, point: Point) -> None:
        number, word, stamp = point
        self.points += 1
        self.counts[number] += 1
        self._pass_time(number, stamp)
        self.values[number] = (word, stamp)
        write = self.writes.get(number)
        if write is not None and write.times > 0 and write.word == word:
            del self.writes[number]
        self.reads.discard(number)
        if number == ERRORS:
            self._note_error(word, stamp)
        if self.on_point is not None:
            self.on_point(point)

    def _pass_time(self, number: int, stamp: int) -> None:
        """Advance the robot's time to the newest stamp; a jump is a gap, a step back a restart of the robot."""
        if self.clock_ms is None:
            if number == TIMESTAMP:
                self.clock_ms = stamp
            return
        ahead = (stamp - self.clock_ms) & 0xFFFFFFFF
        if ahead < HALF:
            self.clock_ms = stamp
            # before time is a channel only the slow list sends it, and it does not reveal gaps
            if ahead >= GAP_MS and self.selection and FIRST_CHANNEL not in self.writes:
                self.gaps += 1
                self.longest_gap_ms = max(self.longest_gap_ms, ahead)
        elif number == TIMESTAMP and (1 << 32) - ahead > 1000:
            self.restarts += 1
            self.clock_ms = stamp
            self._last_error = None
            self._write_selection()

    def _note_error(self, word: int, stamp: int) -> None:
        """Count an error word if it is new: the slow list repeats the last error."""
        if word == 0 or (word, stamp) == self._last_error:
            return
        self._last_error = (word, stamp)
        code, board, count = parts_of_error_word(word)
        name, text = catalogue.error_texts().get(code, (f"error {code}", "not in the table"))
        line = self.errors.pop((board, code), None)
        if line is None:
            line = ErrorLine(all_variables.BOARD_NAMES.get(board, f"board {board}"), code, name, text)
        line.count += count
        line.stamp = stamp
        self.errors[board, code] = line
        self.new_errors.append((line, count))

    # --- for displays -----------------------------------------------------------------------------------

    def state(self, now_s: float) -> str:
        """One word: silent, out of step, or receiving."""
        if self.last_byte_s is None or now_s - self.last_byte_s > 1.0:
            return "silent"
        return "receiving" if self.decoder.in_step else "out of step"

    def counters(self) -> dict[str, int]:
        """Counters by name."""
        return {
            "segments": self.decoder.segments,
            "points": self.points,
            "bad_checksums": self.decoder.bad_checksums,
            "skipped_bytes": self.decoder.skipped_bytes,
            "unknown_points": self.decoder.unknown_points,
            "gaps": self.gaps,
            "longest_gap_ms": self.longest_gap_ms,
            "restarts": self.restarts,
            "packets_sent": self.sent_packets,
        }
