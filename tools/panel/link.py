"""The page's source for the main brain's data link on a serial port: the emulated or the real robot's."""

from __future__ import annotations

import array
import asyncio
from typing import Any

import numpy as np

from ranger_sim.boards.main_brain.data_link import CHANNELS
from ranger_sim.datatable import parameters
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.packing import value_of_word
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness import normal_errors
from ranger_sim.harness.outside.serial_ports import DAQ_BAUD, RealPort, reason_of
from ranger_sim.ranger.names import RANGER
from ranger_sim.tools.panel.channels import EMPTY, Times, Trace, Values, between
from ranger_sim.tools.panel.source import ANKLES, KNOWN_POSE, LEGS, Source, known_pose, known_states, table_channels
from ranger_sim.tools.robodaq.codec import Point
from ranger_sim.tools.robodaq.rates import GAP_PERIODS, Rates, published_hz
from ranger_sim.tools.robodaq.session import OWN, Session

POLL_S = 0.01
MOST_CHOSEN = CHANNELS - len(OWN)
MOST_POINTS = 60_000  # kept of each variable: two minutes of a fast one
USUAL_OF = 50  # points whose median distance is the usual one, until the robot has sent its lists
SLOWEST_S = 0.5  # the slow list comes round in a third of a second (robot.md N4.15)
STEP_S = 1e-3  # the clock of the robot's stamps
NOTHING_S = 1e-4  # a NaN point is this long after the last one before a gap
NO_SLOTS = (
    "The data link brings no slots one by one. The boards report their own in the channels "
    "…_EXECUTION_TIME and …_MAX_EXECUTION_TIME."
)
NO_FRAMES = "The data link brings no frames: a program at the bus shows them (docs/how-to/can-tools.md)."
NOTHING = np.full(1, np.nan, np.float32)


class Kept:
    """The newest points of one variable. after_gap: 1 if the time before the point was too long.

    held: the variable is sent when written and holds its value until the next; else it is sampled.
    """

    def __init__(self, held: bool) -> None:
        self.held = held
        self.times = array.array("d")
        self.values = array.array("f")
        self.after_gap = array.array("b")

    def add(self, time_s: float, value: float, after_gap: bool) -> None:
        """Add a point later than all before."""
        if self.held and not after_gap and self.times and time_s - self.times[-1] > STEP_S:
            self._append(time_s - STEP_S, self.values[-1], False)
        self._append(time_s, value, after_gap)
        if len(self.times) > 2 * MOST_POINTS:
            for row in (self.times, self.values, self.after_gap):
                del row[:MOST_POINTS]

    def _append(self, time_s: float, value: float, after_gap: bool) -> None:
        self.times.append(time_s)
        self.values.append(value)
        self.after_gap.append(after_gap)

    def is_late(self, time_s: float) -> bool:
        """True if the time since the last point is a gap, judged by the usual distance of recent points."""
        near = np.diff(np.asarray(self.times[-USUAL_OF:]))
        usual_s = min(float(np.median(near)), SLOWEST_S) if len(near) else SLOWEST_S
        return bool(self.times) and time_s - self.times[-1] > GAP_PERIODS * usual_s

    def trace(self, begin: float, end: float, points: int) -> Trace:
        """The points that a plot shows of a window: lines from gap to gap."""
        times, values = np.array(self.times), np.array(self.values, np.float32)
        starts = [0, *np.flatnonzero(np.array(self.after_gap)).tolist()]
        found: list[Trace] = []
        for first, last in zip(starts, [*starts[1:], len(times)], strict=True):
            if first < last and times[last - 1] >= begin and times[first] <= end:
                found.append(unbroken(times[first:last], values[first:last], begin, end, points))
        return joined(found)


def unbroken(times: Times, values: Values, begin: float, end: float, points: int) -> Trace:
    """A gapless window of unevenly spaced points, in at most `points` buckets."""
    first, last = np.searchsorted(times, (begin, end))
    first, last = max(0, int(first) - 1), min(len(times), int(last) + 1)  # lines continue beyond the edge
    times, values = times[first:last], values[first:last]
    if len(times) <= 2 * points or end <= begin:
        return Trace(times, values, None)
    width = (end - begin) / points
    bucket = np.floor(times / width).astype(np.int64)
    starts = np.flatnonzero(np.diff(bucket, prepend=bucket[0] - 1))
    x = np.arange(bucket[0], bucket[-1] + 1) * width
    low, high = (
        np.interp(x, x[bucket[starts] - bucket[0]], extreme.reduceat(values, starts)).astype(np.float32)
        for extreme in (np.minimum, np.maximum)
    )
    return Trace(x, low, high)


def joined(pieces: list[Trace]) -> Trace:
    """Pieces one after another, with gaps between them."""
    pieces = [piece for piece in pieces if len(piece.x)]
    if not pieces:
        return EMPTY
    thick = any(piece.high is not None for piece in pieces)
    x, low, high = [], [], []
    for piece in pieces:
        x += [piece.x, piece.x[-1:] + NOTHING_S]
        low += [piece.low, NOTHING]
        high += [piece.low if piece.high is None else piece.high, NOTHING]
    return Trace(np.concatenate(x[:-1]), np.concatenate(low[:-1]), np.concatenate(high[:-1]) if thick else None)


class LinkSource(Source):
    """The data received over `port`. UserError when it cannot be opened."""

    late_s = 2.0  # the slow list comes round in a third of a second, and its lateness is known only later
    can = frozenset({"live", "parameters", "errors", "link", "twins"})
    walks = ("what the panel has received",)

    def __init__(self, port: str) -> None:
        super().__init__()
        self.title = f"data link on {port}"
        self.port = RealPort(port, DAQ_BAUD)
        self.session = Session(self._on_point)
        self.rates = Rates(self.session)
        table = table_channels(known_states())
        self.channels = list(table.values())
        self.place = {number: place for place, number in enumerate(table)}
        self.number = {channel.name: place for place, channel in enumerate(self.channels)}
        self.pose_names = KNOWN_POSE
        self.wanted: tuple[int, ...] = ()
        self.restarts = 0
        self._begin()

    def _begin(self) -> None:
        """Reset: nothing is known yet of this robot, or of the time since its latest power-up."""
        regular = published_hz()
        self.kept = [Kept(number not in regular) for number in self.place]
        self.stamps: dict[int, int] = {}
        self.first_ms: int | None = None
        self.first_errors: dict[tuple[int, int], float] = {}

    def _seconds(self, stamp_ms: int) -> float:
        if self.first_ms is None:
            self.first_ms = stamp_ms
        return ((stamp_ms - self.first_ms + (1 << 31)) % (1 << 32) - (1 << 31)) * 1e-3

    def _on_point(self, point: Point) -> None:
        number, word, stamp = point
        if self.session.restarts != self.restarts:
            self.restarts = self.session.restarts
            self._begin()
        after_gap = self.rates.take(point)
        if number not in self.place:
            return
        kept, time_s = self.kept[self.place[number]], self._seconds(stamp)
        if self.stamps.get(number) == stamp and self.session.clock_ms is not None:
            if not kept.held:
                return  # the slow list repeats a point that another list has already sent
            time_s = self._seconds(self.session.clock_ms) - STEP_S  # written long ago and still valid
        self.stamps[number] = stamp
        if kept.times and time_s <= kept.times[-1]:
            return
        if not self.rates.know:
            after_gap = kept.is_late(time_s)
        value = value_of_word(all_variables.TYPES[number], word)
        kept.add(time_s, value if np.isfinite(value) else np.nan, after_gap)

    async def run(self) -> None:
        """Transfer bytes until the port is lost."""
        loop = asyncio.get_running_loop()
        unsent = b""
        try:
            while True:
                data = self.port.read(1 << 16)
                self.session.receive(data, loop.time())
                unsent += self.session.outgoing(loop.time()) if not unsent else b""
                unsent = unsent[self.port.write(unsent) :]
                await asyncio.sleep(0.0 if data else POLL_S)
        except (OSError, ValueError) as fault:
            self.lost = f"the port is lost: {reason_of(fault)}"

    def close(self) -> None:
        """Close the port."""
        self.port.close()

    # --- displays -------------------------------------------------------------------------------------------

    def span(self) -> tuple[float, float]:
        clock = self.session.clock_ms
        end = 0.0 if clock is None or self.first_ms is None else self._seconds(clock)
        return (max(0.0, end - 120.0), end)

    def want(self, channels: list[int]) -> None:
        """The plots of a page show these channels: ask the robot to send them often."""
        wanted = tuple(sorted(set(channels)))
        if wanted != self.wanted:
            self.wanted = wanted
            rows = [parameters.find(self.channels[channel].name) for channel in wanted[:MOST_CHOSEN]]
            pose = [parameters.find(name) for name in (*LEGS[0], *LEGS[1], *ANKLES)]
            self.session.select(rows, pose[: MOST_CHOSEN - len(rows)])

    def trace(self, channel: int, begin: float, end: float, points: int) -> Trace:
        return self.kept[channel].trace(begin, end, points)

    def samples(self, channel: int, begin: float, end: float) -> tuple[Times, Values]:
        kept = self.kept[channel]
        return between(np.array(kept.times), np.array(kept.values, np.float32), begin, end)

    def values(self, wanted: list[int], at: float | None) -> list[float | None]:
        found: list[float | None] = []
        for channel in wanted:
            kept = self.kept[channel]
            place = len(kept.times) - 1 if at is None else int(np.searchsorted(np.asarray(kept.times), at, "right")) - 1
            value = kept.values[place] if place >= 0 else None
            found.append(value if value is not None and np.isfinite(value) else None)
        return found

    def pose(self, at: float | None) -> tuple[float, list[float]] | None:
        names = [*LEGS[0], *LEGS[1], *ANKLES]
        values = self.values([self.number[name] for name in names], at)
        found = known_pose(dict(zip(names, values, strict=True)))
        return None if found is None else (self.span()[1] if at is None else at, found)

    def state(self, at: float | None) -> dict[str, Any]:
        now_s = self.span()[1]
        rows = []
        for key, line in self.session.errors.items():
            last_s = self._seconds(line.stamp)
            first_s = self.first_errors.setdefault(key, last_s)
            normal = line.count <= normal_errors.most_normal(RANGER, line.board, line.code, now_s, True)
            rows.append(
                {"board": line.board, "name": line.name, "text": line.text, "normal": normal}
                | {"first_s": first_s, "last_s": last_s, "count": line.count}
            )
        loop_s = asyncio.get_running_loop().time()
        return {
            "time_s": now_s,
            "link": {
                "state": self.session.state(loop_s),
                **self.session.counters(),
                "lists": [self._with_seconds(row) for row in self.rates.lists()],
                "chosen": [self._with_seconds(row) for row in self.rates.rows(self.rates.chosen())],
                "asked": "channels" in self.session.pending(),
            },
            "errors": sorted(rows, key=lambda row: row["first_s"]),
            "missing": {"slots": NO_SLOTS, "buses": NO_FRAMES},
        }

    def _with_seconds(self, row: dict[str, Any]) -> dict[str, Any]:
        """A row of the link's rates, with its last gap in the page's time."""
        return {**row, "last_s": None if row["last_ms"] is None else self._seconds(row["last_ms"])}

    async def request(self, request: dict[str, Any]) -> dict[str, Any]:
        if request.get("do") != "set":
            raise UserError("the data link takes parameters alone")
        name, value = request.get("name"), request.get("value")
        if not isinstance(name, str):
            raise UserError(f"set: {str(name)[:40]!r} is not the name of a parameter")
        self.session.write(name, value)  # type: ignore[arg-type]  # what is no number is refused there
        return {"sent": name}
