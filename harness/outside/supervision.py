"""What an external board should send, compared with what it does send.

The master table lists the variables that a board publishes, their ranges, and (with the bus schedule) how often. A
frame carries the network time its board received last; TIMESTAMP frames on the same bus contain that time. All checks
use the time that is given with the frames: when time is slowed down, the robot's own.

    missing        not seen for MISSING_PERIODS periods (or not at all since the start)
    late           a gap longer than a period and its tolerance
    out of range   a value outside the table's minimum and maximum, or not a number
    stale stamp    a frame stamped with a network time older than STALE_MS
    malformed      not a data frame of eight bytes with an 11-bit identifier
    unexpected     a variable that the board publishes but its schedule never sends
    doubled        more frames than the schedule can send: two boards, or an echo
"""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from ranger_sim.datatable.model import Board, Table, Variable
from ranger_sim.datatable.packing import value_of_word
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.harness.outside.bus_schedule import BusSchedule, robots_table, schedule_of_board
from ranger_sim.harness.outside.profile import Profile

SYNC = "TIMESTAMP"
# Chosen by us. A gap: a period, two slots of jitter, and what a busy bus and an adapter's driver may add. Missing:
# three frames in a row did not arrive, which no jitter explains. Stale: satellites take the time every ms, and a frame
# waits some ms at most. Doubled: this many frames come within three quarters of the time that they should take.
GAP_NS = 5_000_000
MISSING_PERIODS = 3
STALE_MS = 20
COUNTED_FRAMES = 19
KINDS = ("missing", "late", "out of range", "stale stamp", "malformed", "unexpected", "doubled")


@dataclasses.dataclass
class Watched:
    """One variable of an external board: what is expected, and what arrived. Times in ns; `period_ns` 0: on demand."""

    variable: Variable
    bus: str
    period_ns: int
    seen: int = 0
    last_ns: int = -1
    longest_gap_ns: int = 0
    missing: bool = False
    faults: dict[str, int] = dataclasses.field(default_factory=dict)
    last_fault: str = ""
    recent: deque[int] = dataclasses.field(default_factory=lambda: deque(maxlen=COUNTED_FRAMES))


def expected_periods(board: Board, schedule: BusSchedule) -> dict[str, tuple[Fraction, Fraction]]:
    """(mean period, longest regular gap) in ms of every variable that a board's schedule sends.

    The longest gaps of a variable in both a row and the occasional list are the row's.
    """
    found: dict[str, tuple[Fraction, Fraction]] = {}
    slot = Fraction(board.slot_us, 1000)
    turn = slot * len(board.rows)

    def add(name: str, gap: Fraction) -> None:
        if name.startswith("("):
            return
        before = found.get(name)
        mean = gap if before is None else 1 / (1 / before[0] + 1 / gap)
        found[name] = (mean, gap if before is None else min(gap, before[1]))

    for name in board.every:
        add(name, slot * schedule.turns(name))
    for row in board.rows:
        for name in row:
            add(name, turn * schedule.turns(name))
    for name in board.occasional:
        add(name, turn * schedule.occasional.get(board.name, 1) * (len(board.occasional) + 1))
    return found


class Watch:
    """Supervises the external boards of a profile. `start_ns`: when they should begin to send."""

    def __init__(self, profile: Profile, start_ns: int = 0, table: Table | None = None) -> None:
        table = table if table is not None else robots_table()
        self.start_ns = start_ns
        self.now_ns = start_ns
        self.faults = 0
        self.boards: dict[str, list[Watched]] = {}
        self.watched: dict[tuple[str, int], tuple[str, Watched]] = {}
        self.sync_id = table.variable(SYNC).id
        self.sync_ms: dict[str, int] = {}  # network time received last, by bus
        schedules = profile.schedules()
        for name in profile.external():
            board = table.board(name)
            self.boards[name] = []
            if board.role == "satellite":
                self._expect(board, expected_periods(board, schedule_of_board(schedules, board)), table)
            elif board.role == "router":
                self._expect_of_router(board, table)
            # the main brain has no CAN: what it sends arrives by the router

    def _expect(self, board: Board, periods: Mapping[str, tuple[Fraction, Fraction]], table: Table) -> None:
        for variable in table.published_by(board.name):
            bus = board.buses[0].lower()
            if bus.upper() not in variable.buses:
                continue
            # an error is sent only while one waits
            gap = Fraction(0) if variable.is_error_word or variable.name not in periods else periods[variable.name][1]
            self._watch(board.name, variable, bus, int(gap * 1_000_000))

    def _expect_of_router(self, board: Board, table: Table) -> None:
        """Expect TIMESTAMP on every bus, and the commands that the router passes on."""
        for variable in table.variables:
            for bus in variable.buses:
                if not bus.startswith("CAN"):
                    continue
                if variable.name in board.sends_itself and variable.period_ms is not None:
                    self._watch(board.name, variable, bus.lower(), int(variable.period_ms * 1_000_000))
                elif variable.publisher in ("MB", "PC"):
                    self._watch(board.name, variable, bus.lower(), 0)

    def _watch(self, board: str, variable: Variable, bus: str, period_ns: int) -> None:
        one = Watched(variable, bus, period_ns)
        self.boards[board].append(one)
        self.watched[bus, variable.id] = (board, one)

    # ---- arrivals

    def frame(self, time_ns: int, bus: str, identifier: int, flags: int, lo: int, hi: int) -> None:
        """Check a frame on a bus (every one, also our own: they include the network time); flags as FLAG_*."""
        self.now_ns = max(self.now_ns, time_ns)
        if flags & FLAG_ERROR or flags & FLAG_EXTENDED:
            return
        if identifier == self.sync_id and not flags & FLAG_REMOTE:
            self.sync_ms[bus] = hi
        found = self.watched.get((bus, identifier))
        if found is None:
            return
        one = found[1]
        if flags & FLAG_REMOTE or flags & 15 != 8:
            self._note(
                one, "malformed", f"{'remote frame' if flags & FLAG_REMOTE else f'{flags & 15} bytes'} instead of 8"
            )
            return
        self._judge_rhythm(one, time_ns)
        self._judge_value(one, lo)
        # an error word carries the time at which the error was recorded, a command the main brain's view of the time
        own_stamp = one.variable.publisher == found[0] and not one.variable.is_error_word and identifier != self.sync_id
        if own_stamp and bus in self.sync_ms:
            age = (self.sync_ms[bus] - hi) & 0xFFFFFFFF
            if STALE_MS < age < 1 << 31:
                self._note(one, "stale stamp", f"stamped {hi} ms at {self.sync_ms[bus]} ms")
        one.seen += 1
        one.last_ns = time_ns
        one.missing = False

    def _judge_rhythm(self, one: Watched, time_ns: int) -> None:
        if one.period_ns == 0:
            if one.variable.publisher != "MB" and not one.variable.is_error_word and one.seen == 0:
                self._note(one, "unexpected", "its schedule never sends it")
            return
        if one.last_ns >= 0:
            gap = time_ns - one.last_ns
            one.longest_gap_ns = max(one.longest_gap_ns, gap)
            if gap > one.period_ns + GAP_NS and not one.missing:
                self._note(one, "late", f"{gap / 1e6:.1f} ms after the one before, period {one.period_ns / 1e6:g} ms")
        one.recent.append(time_ns)
        took = one.recent[-1] - one.recent[0]
        if len(one.recent) == COUNTED_FRAMES and 4 * took < 3 * (COUNTED_FRAMES - 1) * one.period_ns:
            self._note(one, "doubled", f"{COUNTED_FRAMES} frames in {took / 1e6:.1f} ms")
            one.recent.clear()

    def _judge_value(self, one: Watched, word: int) -> None:
        variable = one.variable
        value = value_of_word(variable.type, word & 0xFFFFFFFF)
        if not math.isfinite(value):
            self._note(one, "out of range", f"{value} is not a number")
        elif (variable.minimum is not None and value < variable.minimum) or (
            variable.maximum is not None and value > variable.maximum
        ):
            allowed = f"{_limit(variable.minimum)} ... {_limit(variable.maximum)} {variable.unit}".rstrip()
            self._note(one, "out of range", f"{value:g} is outside {allowed}")

    def check(self, now_ns: int) -> None:
        """Check for frames that are missing; call it every 10 ms or so."""
        self.now_ns = max(self.now_ns, now_ns)
        for _, one in self.watched.values():
            if one.period_ns == 0 or one.missing:
                continue
            since = one.last_ns if one.last_ns >= 0 else self.start_ns
            if self.now_ns - since > MISSING_PERIODS * one.period_ns + GAP_NS:
                one.missing = True
                ago = f"not for {(self.now_ns - since) / 1e6:.1f} ms" if one.last_ns >= 0 else "never seen"
                self._note(one, "missing", f"{ago}, period {one.period_ns / 1e6:g} ms")

    def _note(self, one: Watched, kind: str, text: str) -> None:
        one.faults[kind] = one.faults.get(kind, 0) + 1
        one.last_fault = f"{kind}: {text}"
        self.faults += 1

    # ---- reports

    def report(self) -> dict[str, Any]:
        """By board: frames seen, variables expected and seen, counts of faults, and every variable with a fault."""
        found: dict[str, Any] = {}
        for name, variables in self.boards.items():
            counts = dict.fromkeys(KINDS, 0)
            troubled = []
            for one in variables:
                for kind, count in one.faults.items():
                    counts[kind] += count
                if one.faults:
                    troubled.append(
                        {
                            "variable": one.variable.name,
                            "bus": one.bus,
                            "seen": one.seen,
                            "period_ms": one.period_ns / 1e6 if one.period_ns else None,
                            "longest_gap_ms": one.longest_gap_ns / 1e6,
                            "missing_now": one.missing,
                            "faults": dict(one.faults),
                            "last": one.last_fault,
                        }
                    )
            expected = [one for one in variables if one.period_ns]
            found[name] = {
                "frames": sum(one.seen for one in variables),
                "expected": len(expected),
                "seen": sum(one.seen > 0 for one in expected),
                "missing_now": sum(one.missing for one in expected),
                "faults": {kind: count for kind, count in counts.items() if count},
                "variables": troubled,
            }
        return found

    def lines(self) -> list[str]:
        """The report for people: a line per board, and one per variable with a fault."""
        lines = []
        for name, board in self.report().items():
            counts = ", ".join(f"{kind} {count}" for kind, count in board["faults"].items()) or "no faults"
            lines.append(
                f"{name}: {board['seen']} of {board['expected']} variables, {board['frames']} frames; {counts}"
            )
            for one in board["variables"]:
                counts = ", ".join(f"{kind} {count}" for kind, count in one["faults"].items())
                lines.append(f"  {one['variable']} on {one['bus']}: {counts}; last {one['last']}")
        return lines


def _limit(value: float | int | None) -> str:
    return "any" if value is None else f"{value:g}"
