"""A processor's activity, as slices: slots with their tasks, interrupts, turns of the main loop."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ranger_sim.firmware_sim.activity import (
    ACTIVITY_COLUMNS,
    COLUMN_CYCLES,
    COLUMN_END,
    COLUMN_ITEMS,
    COLUMN_KIND,
    COLUMN_NUMBER,
    COLUMN_ROW,
    COLUMN_START,
    SLOT_BEGAN,
    SLOT_ENDED,
    SLOT_OVERRAN,
    TASK_DROPPED,
)
from ranger_sim.foundation.events import NEVER
from ranger_sim.harness.timeline.activity_parts import (
    COLUMNS,
    CYCLES,
    END,
    FAST,
    LATENCY,
    NUMBER,
    OTHERS,
    SERVICES,
    START,
    TASKS,
    TURNS,
    ActivityParts,
)
from ranger_sim.harness.timeline.model import Instant, Instants, Slices


class Processor:
    """One board's activity. `rows`: of its ActivityLog, one array or more after one another; `legend`: the meaning of
    their numbers; `windows`: (begin, end) of the times that the rows are of, in which each ends; None: all.

    `slots`, with the tasks inside. `services`: the interrupts, the fast ones inside those that they interrupted.
    `turns` of the main loop. `services_asked_ns`, `fast_asked_ns`: when each of them was requested.
    """

    def __init__(
        self,
        legend: Any,
        rows: Sequence[np.ndarray],
        zero_ns: int,
        windows: Sequence[tuple[int, int]] | None = None,
    ) -> None:
        self.name = legend.board
        windows = windows if windows is not None else [(-NEVER, NEVER)]
        self.gaps = np.array([*(end for _, end in windows[:-1]), NEVER], dtype=np.int64) + 1
        self.legend = legend
        self.zero_ns = zero_ns
        parts = parted(legend, rows, windows)
        kind = parts[OTHERS][:, COLUMN_KIND]
        self.tasks = self._tasks(parts[TASKS])
        slots = (parts[OTHERS][kind == each] for each in (SLOT_ENDED, SLOT_BEGAN, SLOT_OVERRAN))
        self.slots = self._slots(*slots)
        self.slots.inside = self.tasks
        self.fast = self._services(parts[FAST])
        self.services = self._services(parts[SERVICES])
        self.services.inside = self.fast
        self.fast_asked_ns, self.services_asked_ns = self._asked(self.fast), self._asked(self.services)
        self.turns = self._turns(parts[TURNS])
        self.overruns = self._overruns(parts[OTHERS][(kind == SLOT_OVERRAN) | (kind == TASK_DROPPED)])

    def tracks(self) -> list[Slices]:
        """All tracks that are not empty."""
        found = [self.slots, self.services, self.turns]
        return [slices for slices in found if len(slices) or (slices.inside is not None and len(slices.inside))]

    def _made(self, track: str, names: list[str], part: np.ndarray, name: np.ndarray, **notes: np.ndarray) -> Slices:
        start, end = part[START] - self.zero_ns, part[END] - self.zero_ns
        return Slices(("Boards", self.name, track), names, start, end, name, dict(notes))

    def _tasks(self, part: np.ndarray) -> Slices:
        """Tasks and waits; of an occasional list its entry."""
        names = [task.name for task in self.legend.tasks]
        return self._made("slots", names, part, part[NUMBER], cycles=part[CYCLES])

    def _slots(self, rows: np.ndarray, begun: np.ndarray, overrun: np.ndarray) -> Slices:
        """One slice per slot, named by its row. A slot that waits for the end of an overrun one begins after that.

        One that has not ended, because it is running or its processor stopped in it, lasts until the end of its latest
        task. One that was dropped as a whole has no slice.
        """
        names = [f"row {row}" for row in range(len(self.legend.rows))]
        began = begun[:, COLUMN_START]
        dropped = np.zeros(len(began), dtype=bool)
        places = np.searchsorted(began, overrun[:, COLUMN_START])
        known = np.isin(overrun[:, COLUMN_START], began)
        dropped[places[known]] = overrun[known, COLUMN_ITEMS] == begun[places[known], COLUMN_ITEMS]
        open_ = begun[~dropped & ~np.isin(began, rows[:, COLUMN_START])].copy()
        next_ns = np.append(began, NEVER)[np.searchsorted(began, open_[:, COLUMN_START]) + 1]
        next_ns = np.minimum(next_ns, self.gaps[np.searchsorted(self.gaps, open_[:, COLUMN_START])])
        ends = np.append(0, self.tasks.end_ns + self.zero_ns)  # of the latest task before that, be it an earlier slot's
        latest = ends[np.searchsorted(self.tasks.start_ns + self.zero_ns, next_ns)]
        open_[:, COLUMN_END] = np.maximum(open_[:, COLUMN_START], latest)
        open_[:, COLUMN_CYCLES] = (open_[:, COLUMN_END] - open_[:, COLUMN_START]) * self.legend.cycles_per_ns
        rows = np.concatenate([rows, open_])
        rows = rows[np.argsort(rows[:, COLUMN_START], kind="stable")]
        times = rows[:, [COLUMN_START, COLUMN_END]].T
        slots = self._made("slots", names, times, rows[:, COLUMN_ROW], cycles=rows[:, COLUMN_CYCLES])
        if len(slots):
            slots.start_ns[1:] = np.maximum(slots.start_ns[1:], slots.end_ns[:-1])
        return slots

    def _services(self, part: np.ndarray) -> Slices:
        names = [source.name for source in self.legend.interrupts]
        if (part[START, 1:] < part[START, :-1]).any():
            part = part[:, np.argsort(part[START], kind="stable")]
        notes = {"cycles": part[CYCLES], "latency_us": part[LATENCY] * 1e-3}
        return self._made("interrupts", names, part, part[NUMBER], **notes)

    def _asked(self, services: Slices) -> np.ndarray:
        """Request times; start and latency are those of the way to the handler, with the source's own latency."""
        ways_ns = [int(source.latency / self.legend.cycles_per_ns) for source in self.legend.interrupts]
        latency_ns = np.round(services.notes["latency_us"] * 1e3).astype(np.int64)
        asked_ns: np.ndarray = services.start_ns + np.array([*ways_ns, 0])[services.name] - latency_ns
        return asked_ns

    def _turns(self, part: np.ndarray) -> Slices:
        return self._made("main loop", ["turn"], part, np.zeros_like(part[NUMBER]))

    def _overruns(self, rows: np.ndarray) -> Instants:
        """Each slot that a tick found unfinished, with the names of the dropped tasks."""
        dropped: dict[int, list[str]] = {}
        for row in rows[rows[:, COLUMN_KIND] == TASK_DROPPED]:
            dropped.setdefault(int(row[COLUMN_END]), []).append(self.legend.tasks[int(row[COLUMN_NUMBER])].name)
        events = []
        for row in rows[rows[:, COLUMN_KIND] == SLOT_OVERRAN]:
            time = int(row[COLUMN_END])
            notes: dict[str, str | float] = {"slot": float(row[COLUMN_NUMBER]), "dropped": float(row[COLUMN_ITEMS])}
            if time in dropped:
                notes["functions"] = ", ".join(dropped[time])
            events.append(Instant(time - self.zero_ns, f"row {int(row[COLUMN_ROW])} overran", notes))
        return Instants(("Boards", self.name, "overruns"), events)


def parted(legend: Any, rows: Sequence[np.ndarray], windows: Sequence[tuple[int, int]]) -> list[np.ndarray]:
    """The columns of each part (ActivityParts), and the rows of OTHERS."""
    fast, lists = [source.fast for source in legend.interrupts], [bool(task.entries) for task in legend.tasks]
    parts = ActivityParts([time for window in windows for time in window], fast, lists)
    flat: list[Any] = [each.reshape(-1) for each in rows]
    for each in flat:
        parts.count(each)
    parts.allocate(lambda size, columns: np.empty(size * columns, dtype=np.int64))
    for each in flat:
        parts.take(each)
    columns = [
        kept.reshape(COLUMNS, -1)[:, :count] for kept, count in zip(parts.kept[:OTHERS], parts.counts, strict=False)
    ]
    return [*columns, parts.kept[OTHERS].reshape(-1, ACTIVITY_COLUMNS)]
