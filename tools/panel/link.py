"""The page's source for the main brain's data link on a serial port: emulated or the real robot's."""

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
from ranger_sim.harness.ranger_names import RANGER
from ranger_sim.tools.panel.channels import EMPTY, Times, Trace, Values, between, thinned
from ranger_sim.tools.panel.source import ANKLES, KNOWN_POSE, LEGS, Source, known_pose, table_channels
from ranger_sim.tools.robodaq.codec import Point
from ranger_sim.tools.robodaq.session import OWN, Session

LOOK_S = 0.01
MOST_CHOSEN = CHANNELS - len(OWN)
MOST_POINTS = 60_000  # kept of each variable: two minutes of a fast one
USUAL_OF = 50  # points whose median distance is the usual one
SLOWEST_S = 0.5  # the slow list comes round in a third of a second (robot.md N4.15): what is later is a gap


class Kept:
    """The newest points of one variable."""

    def __init__(self) -> None:
        self.times = array.array("d")
        self.values = array.array("f")

    def add(self, time_s: float, value: float) -> None:
        self.times.append(time_s)
        self.values.append(value)
        if len(self.times) > 2 * MOST_POINTS:
            del self.times[:MOST_POINTS]
            del self.values[:MOST_POINTS]

    def period_s(self) -> float:
        """Usual distance of two points, s."""
        near = np.diff(np.asarray(self.times[-USUAL_OF:]))
        return float(np.median(near)) if len(near) else SLOWEST_S


class LinkSource(Source):
    """What comes over `port`. UserError when it cannot be opened."""

    can = frozenset({"live", "parameters", "errors", "link"})

    def __init__(self, port: str) -> None:
        super().__init__()
        self.title = f"data link on {port}"
        self.port = RealPort(port, DAQ_BAUD)
        self.session = Session(self._hear)
        table = table_channels()
        self.channels = list(table.values())
        self.place = {number: place for place, number in enumerate(table)}
        self.number = {channel.name: place for place, channel in enumerate(self.channels)}
        self.kept = [Kept() for _ in self.channels]
        self.pose_names = KNOWN_POSE
        self.wanted: tuple[int, ...] = ()
        self.first_ms: int | None = None
        self.first_errors: dict[tuple[int, int], float] = {}

    def _seconds(self, stamp_ms: int) -> float:
        if self.first_ms is None:
            self.first_ms = stamp_ms
        return ((stamp_ms - self.first_ms + (1 << 31)) % (1 << 32) - (1 << 31)) * 1e-3

    def _hear(self, point: Point) -> None:
        number, word, stamp = point
        if number in self.place:
            kept, time_s = self.kept[self.place[number]], self._seconds(stamp)
            if kept.times and time_s <= kept.times[-1]:
                return  # the slow list brings a point again that has come by another
            value = value_of_word(all_variables.TYPES[number], word)
            kept.add(time_s, value if np.isfinite(value) else np.nan)

    async def run(self) -> None:
        """Carry bytes until the port is lost."""
        loop = asyncio.get_running_loop()
        unsent = b""
        try:
            while True:
                data = self.port.read(1 << 16)
                self.session.receive(data, loop.time())
                unsent += self.session.outgoing(loop.time()) if not unsent else b""
                unsent = unsent[self.port.write(unsent) :]
                await asyncio.sleep(0.0 if data else LOOK_S)
        except (OSError, ValueError) as fault:
            self.lost = f"the port is lost: {reason_of(fault)}"

    def close(self) -> None:
        """Give the port back."""
        self.port.close()

    # --- what is shown --------------------------------------------------------------------------------------

    def span(self) -> tuple[float, float]:
        clock = self.session.clock_ms
        end = 0.0 if clock is None or self.first_ms is None else self._seconds(clock)
        return (max(0.0, end - 120.0), end)

    def want(self, channels: list[int]) -> None:
        """The plots of a page show these: the robot is asked to send them often."""
        wanted = tuple(sorted(set(channels)))
        if wanted != self.wanted:
            self.wanted = wanted
            rows = [parameters.find(self.channels[channel].name) for channel in wanted]
            pose = [parameters.find(name) for name in (*LEGS[0], *LEGS[1], *ANKLES)]
            self.session.select(rows, pose[: MOST_CHOSEN - len(rows)])

    def trace(self, channel: int, begin: float, end: float, points: int) -> Trace:
        kept = self.kept[channel]
        if not kept.times:
            return EMPTY
        times, values = np.array(kept.times), np.array(kept.values, np.float32)
        return thinned(times, values, begin, end, points, min(kept.period_s(), SLOWEST_S))

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
            "link": {"state": self.session.state(loop_s), **self.session.counters()},
            "errors": sorted(rows, key=lambda row: -row["last_s"]),
        }

    async def request(self, wish: dict[str, Any]) -> dict[str, Any]:
        if wish.get("do") != "set":
            raise UserError("the data link takes parameters alone")
        name, value = wish.get("name"), wish.get("value")
        if not isinstance(name, str):
            raise UserError(f"set: {str(name)[:40]!r} is no name of a parameter")
        self.session.write(name, value)  # type: ignore[arg-type]  # what is no number is refused there
        return {"sent": name}
