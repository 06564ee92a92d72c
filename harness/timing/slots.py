"""A board's slots, for tests: one by one, by function, by interrupt; and assertions about them.

    slots = robot.slots("MCH")          # from here on everything is recorded
    robot.until("step 4")
    slots.assert_no_overrun()
    slots.assert_within("450 us")
    slots.of_row(3).assert_function("motor_encoder_rezero", at_most=8000)
    slots.between("2 s", "3 s").assert_latency("encoder_edge_0", at_most="8 us")
    print(slots.worst().picture())

A limit is a number of cycles (a whole number) or a time (text with a unit); a value equal to it passes. An assertion
that fails shows the slot that is farthest off, to scale. A query on a view without any slot is a UserError: nothing
was recorded, or nothing was selected, so there is no answer.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Iterator
from typing import Any, Self

import numpy as np

from ranger_sim.firmware_sim.activity import (
    COLUMN_CYCLES,
    COLUMN_ITEMS,
    COLUMN_KIND,
    COLUMN_LATENCY,
    COLUMN_NUMBER,
    COLUMN_START,
    INTERRUPT_RAN,
    MAIN_LOOP_RAN,
    TASK_DROPPED,
    TASK_RAN,
    WAIT_RAN,
)
from ranger_sim.firmware_sim.legend import Legend
from ranger_sim.foundation.quantities import Duration, duration_ns, duration_text, given_text, nanoseconds
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.timing import picture
from ranger_sim.harness.timing.recording import Recording

MAIN_LOOP = "main loop"
Limit = int | str
Instant = Duration  # since power-up


@dataclasses.dataclass(frozen=True)
class Ran:
    """One execution: `cycles` its own, from `start_ns` to `end_ns` interruptions included. Latency: of interrupts."""

    name: str
    start_ns: int
    end_ns: int
    cycles: int
    items: int
    latency_ns: int = 0
    limit: int = 0
    interrupt: bool = False
    main_loop: bool = False
    chooses: bool = False  # an occasional list, whose entry has its own execution


@dataclasses.dataclass(frozen=True)
class Statistics:
    """A function or an interrupt over many slots, in cycles. `limit` 0: none. `latency_ns`: an interrupt's longest."""

    name: str
    calls: int
    least: int
    median: float
    most: int
    total: int
    limit: int = 0
    over_limit: int = 0
    most_items: int = 0
    latency_ns: int = 0


class Slot:
    """One slot: `number` since the board's power-up, `row` of its table, `start_ns` since the robot's power-up.

    `cycles` and `end_ns`: to the end of its last task, interrupts included. `ran`: functions, interrupts and turns of
    the main loop in order of their start, up to the next tick; it includes what began after the slot's end, but
    `cycles` does not. `reached_in`: what the tick found running, such as a turn of the main loop; the slot waited for
    it. `dropped`: names of the tasks that an overrun dropped.
    """

    def __init__(self, recording: Recording, place: int) -> None:
        slots = recording.slots
        self.recording = recording
        self.rows = recording.rows
        first, last = int(slots.first[place]), int(slots.last[place])
        self.own = self.rows[first:last]
        mine = (recording.slot_of == slots.place[place]) & (self.rows[:, COLUMN_KIND] == TASK_DROPPED)
        self.dropped_numbers = self.rows[mine, COLUMN_NUMBER].tolist() if slots.overran[place] else []
        self.legend = recording.legend()
        self.number = int(slots.number[place])
        self.row = int(slots.row[place])
        self.start_ns = int(slots.start[place])
        self.end_ns = int(slots.end[place])
        self.cycles = int(slots.cycles[place])
        self.overran = bool(slots.overran[place])

    @property
    def board(self) -> str:
        """Name of the board."""
        return self.legend.board

    @property
    def taken_ns(self) -> int:
        """From its tick to the end of its last task."""
        return self.end_ns - self.start_ns

    @property
    def ran(self) -> list[Ran]:
        """Functions, interrupts and turns of the main loop in order of their start."""
        return self._executions(self.own)

    @property
    def reached_in(self) -> list[Ran]:
        """What had begun before its tick and was not finished."""
        place = int(np.searchsorted(self.rows[:, COLUMN_START], self.start_ns))
        return self._executions(self.recording.reaching_into(place, self.start_ns))

    @property
    def functions(self) -> list[Ran]:
        """Tasks and waits, in order."""
        return [each for each in self.ran if not each.interrupt and not each.main_loop]

    @property
    def turns(self) -> list[Ran]:
        """Turns of the main loop outside the scheduler, as on the router, from its tick to the next."""
        return [each for each in self.ran if each.main_loop]

    @property
    def interrupts(self) -> list[Ran]:
        """Interrupts from its tick to the next, in order."""
        return [each for each in self.ran if each.interrupt]

    @property
    def dropped(self) -> list[str]:
        """Tasks that had not begun at the next tick."""
        return [self.legend.tasks[number].name for number in self.dropped_numbers]

    @property
    def margin(self) -> float:
        """The share of its slot that was left; below 0 when it took longer."""
        return 1.0 - self.taken_ns / self.legend.slot_ns

    def cycles_by_function(self) -> dict[str, int]:
        """Cycles of each function that ran."""
        return _summed(self.functions)

    def cycles_by_interrupt(self) -> dict[str, int]:
        """Cycles of each interrupt that was served."""
        return _summed(self.interrupts)

    def picture(self, limit_ns: int | None = None) -> str:
        """What had the processor, to scale."""
        begin, end = np.searchsorted(self.rows[:, COLUMN_START], (self.start_ns, max(self.end_ns, self.start_ns + 1)))
        window = self._executions(self.rows[begin:end])
        if self.end_ns > self.start_ns + self.legend.slot_ns:  # tasks of the slots after it are not its own
            window = [each for each in window if each.end_ns <= self.end_ns]
        return picture.of_slot(self, self._from_its_tick(window) + window, limit_ns)

    def _from_its_tick(self, window: list[Ran]) -> list[Ran]:
        """What reached into it, with its cycles after the tick; `window`: what began from the tick on."""
        found = []
        for each in self.reached_in:
            left_ns = min(each.end_ns, self.end_ns) - self.start_ns
            inside = sum(one.cycles for one in window if one.interrupt and one.end_ns <= each.end_ns)
            cycles = max(0, round(left_ns * self.legend.cycles_per_ns) - inside)
            found.append(dataclasses.replace(each, name=f"{each.name} (before)", cycles=cycles))
        return found

    def _executions(self, rows: np.ndarray) -> list[Ran]:
        found = []
        for kind, number, start, end, cycles, latency, _, items in rows.tolist():
            if kind == INTERRUPT_RAN:
                name = self.legend.interrupts[number].name
                found.append(Ran(name, start, end, cycles, items, latency_ns=latency, interrupt=True))
            elif kind in (TASK_RAN, WAIT_RAN):
                task = self.legend.tasks[number]
                chooses = bool(task.entries)
                found.append(Ran(task.name, start, end, cycles, items, limit=task.limit, chooses=chooses))
            elif kind == MAIN_LOOP_RAN:
                found.append(Ran(MAIN_LOOP, start, end, cycles, items, main_loop=True))
        return found

    def __repr__(self) -> str:
        how = ", overran" if self.overran else ""
        return (
            f"<slot {self.number} of {self.board}, row {self.row}, {self.start_ns * 1e-9:.6f} s: "
            f"{self.cycles} cycles, {duration_text(self.taken_ns)}{how}>"
        )


def _summed(executions: list[Ran]) -> dict[str, int]:
    sums: dict[str, int] = {}
    for each in executions:
        sums[each.name] = sums.get(each.name, 0) + each.cycles
    return sums


class SlotView:
    """The recorded slots of a board, or a selection of them. Iterate, query, assert; it grows with time."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        # the name of each selection, and which slots of `Recording.slots` it takes
        self.chosen: tuple[tuple[str, Callable[[Any], np.ndarray]], ...] = ()
        self.from_ns = 0  # no slot before is chosen

    # --- selections ---------------------------------------------------------------------------------------

    def of_row(self, row: int) -> Self:
        """Only slots of this row of the table."""
        count = len(self.legend.rows)
        if not 0 <= row < count:
            raise UserError(f"slots of {self.board}: row {row!r} is none of 0 ... {count - 1}")
        return self._select(f"of row {row}", lambda slots: slots.row == row)

    def between(self, begin: Instant, end: Instant) -> Self:
        """Only slots that begin from `begin` on and before `end` (since the robot's power-up)."""
        first, last = _time_ns(begin), _time_ns(end)
        if last <= first:
            raise UserError(f"slots of {self.board}: nothing is between {begin} and {end}")
        called = f"between {duration_text(first)} and {duration_text(last)}"
        selected = self._select(called, lambda slots: (slots.start >= first) & (slots.start < last))
        selected.from_ns = max(first, self.from_ns)
        return selected

    def during(self, called: str, held: Callable[[np.ndarray], np.ndarray]) -> Self:
        """Only slots at whose start `held` (of an array of times, ns since power-up) is true."""
        return self._select(called, lambda slots: held(slots.start))

    def _select(self, called: str, which: Callable[[Any], np.ndarray]) -> Self:
        """The same view with another selection."""
        selected = copy.copy(self)
        selected.chosen = (*self.chosen, (called, which))
        return selected

    def forget(self) -> None:
        """Discard what was recorded so far."""
        self.recording.forget()

    # --- the slots ----------------------------------------------------------------------------------------

    @property
    def legend(self) -> Legend:
        """Names, costs and limits of the board's table, as they are now."""
        return self.recording.legend()

    @property
    def board(self) -> str:
        """Name of the board."""
        return self.legend.board

    def __str__(self) -> str:
        return " ".join((f"slots of {self.board}", *(called for called, _ in self.chosen)))

    def _places(self) -> np.ndarray:
        """Indices of the chosen slots in `Recording.slots`."""
        slots = self.recording.update()
        mask = np.ones(len(slots), dtype=bool)
        for _, which in self.chosen:
            mask &= which(slots)
        return np.flatnonzero(mask)

    def _some(self) -> np.ndarray:
        """The same; UserError when there are none, or older ones were discarded."""
        places = self._places()
        began = duration_text(self.recording.begun_ns)
        rows = self.recording.rows
        kept_ns = int(rows[0, COLUMN_START]) if self.recording.lost and len(rows) else 0
        if self.from_ns < kept_ns:
            raise UserError(
                f"{self}: the oldest were dropped, the rest begins {duration_text(kept_ns)} after power-up; "
                f"ask .between(...) two times after that, or call forget() now and then"
            )
        if not len(places):
            raise UserError(
                f"{self}: none was recorded; recording began {began} after power-up, when it was first asked for: "
                f'robot.slots("{self.board}") comes before the time that it is to record'
            )
        return places

    def __len__(self) -> int:
        return len(self._places())

    def __iter__(self) -> Iterator[Slot]:
        for place in self._places():
            yield Slot(self.recording, int(place))

    def __getitem__(self, number: int) -> Slot:
        return Slot(self.recording, int(self._places()[number]))

    @property
    def overruns(self) -> int:
        """The number of slots unfinished at the next tick."""
        places = self._some()
        return int(self.recording.slots.overran[places].sum())

    @property
    def dropped(self) -> dict[str, int]:
        """Tasks that overruns dropped, and how often."""
        found: dict[str, int] = {}
        places = self._some()
        for place in places[self.recording.slots.overran[places]]:
            for name in Slot(self.recording, int(place)).dropped:
                found[name] = found.get(name, 0) + 1
        return found

    def worst(self) -> Slot:
        """The one that took longest."""
        places = self._some()
        slots = self.recording.slots
        return Slot(self.recording, int(places[np.argmax(slots.end[places] - slots.start[places])]))

    @property
    def margin(self) -> float:
        """The share of its slot that the worst one left; below 0 when it took longer."""
        return self.worst().margin

    # --- functions and interrupts -------------------------------------------------------------------------

    def _rows(self, *kinds: int) -> np.ndarray:
        """Rows of these kinds in the chosen slots."""
        chosen = self._some()
        recording = self.recording
        wanted = np.zeros(len(recording.slot_of) + 1, dtype=bool)
        wanted[recording.slots.place[chosen]] = True
        inside = wanted[recording.slot_of] & (recording.slot_of >= 0)
        return recording.rows[inside & np.isin(recording.rows[:, COLUMN_KIND], kinds)]

    @property
    def functions(self) -> dict[str, Statistics]:
        """Every function that ran, by name, in the order of the table."""
        rows = self._rows(TASK_RAN, WAIT_RAN)
        return _by_name(rows, [task.name for task in self.legend.tasks], [task.limit for task in self.legend.tasks])

    @property
    def interrupts(self) -> dict[str, Statistics]:
        """Every interrupt that was served, by name."""
        rows = self._rows(INTERRUPT_RAN)
        names = [source.name for source in self.legend.interrupts]
        return _by_name(rows, names, [0] * len(names))

    @property
    def main_loop(self) -> Statistics | None:
        """Turns of the main loop outside the scheduler; None without any."""
        rows = self._rows(MAIN_LOOP_RAN)
        return _statistics(MAIN_LOOP, rows, 0) if len(rows) else None

    def _named(self, what: str, name: str, all_names: list[str], ran: dict[str, Statistics]) -> None:
        if name not in all_names:
            raise UserError(f"{self}: no {what} is named {name!r}; there are {', '.join(dict.fromkeys(all_names))}")
        if name not in ran:
            raise UserError(f"{self}: {name} ran in none of the {len(self)}")

    def _worst_run(self, name: str, column: Callable[[np.ndarray], np.ndarray], *kinds: int) -> tuple[int, Slot]:
        """The largest of `column` over the executions of `name`, and the slot that had it."""
        legend = self.legend
        listed = legend.interrupts if INTERRUPT_RAN in kinds else legend.tasks
        numbers = [number for number, one in enumerate([each.name for each in listed]) if one == name]
        rows = self._rows(*kinds)
        rows = rows[np.isin(rows[:, COLUMN_NUMBER], numbers)]
        values = column(rows)
        at = int(np.argmax(values))
        slots = self.recording.slots
        place = int(np.searchsorted(slots.start, rows[at, COLUMN_START], side="right")) - 1
        return int(values[at]), Slot(self.recording, place)

    # --- assertions (pytest shows the line that asserts, not these) -----------------------------------------

    def assert_no_overrun(self) -> None:
        """Assert that no slot was unfinished at the next tick."""
        __tracebackhide__ = True
        count = self.overruns
        if count:
            places = self._places()
            slots = self.recording.slots
            late = places[slots.overran[places]]
            worst = Slot(self.recording, int(late[np.argmax(slots.end[late] - slots.start[late])]))
            dropped = ", ".join(f"{name} {n} times" if n > 1 else name for name, n in self.dropped.items())
            text = f"{count} of {len(places)} overran; dropped: {dropped or 'nothing'}; the worst:"
            self._fail(text, worst, self.legend.slot_ns)

    def assert_within(self, at_most: Limit) -> None:
        """Assert that every slot ended within `at_most` of its tick, interrupts included."""
        __tracebackhide__ = True
        limit_ns = self._limit_ns(at_most)
        places = self._some()
        slots = self.recording.slots
        taken = slots.end[places] - slots.start[places]
        over = int(((slots.cycles[places] > at_most) if isinstance(at_most, int) else (taken > limit_ns)).sum())
        if over:
            worst = self.worst()
            text = f"{over} of {len(places)} took longer than {_limit_text(at_most)}; the worst:"
            self._fail(text, worst, limit_ns)

    def assert_function(self, name: str, at_most: Limit) -> None:
        """Assert that no execution of function `name` cost more than `at_most`, interrupts not included."""
        __tracebackhide__ = True
        self._named("function", name, [task.name for task in self.legend.tasks], self.functions)
        cycles, slot = self._worst_run(name, lambda rows: rows[:, COLUMN_CYCLES], TASK_RAN, WAIT_RAN)
        self._compare(f"{name} cost", cycles, at_most, slot)

    def assert_interrupt(self, name: str, at_most: Limit) -> None:
        """Assert that no service of interrupt `name` cost more than `at_most`, its own interruptions excluded."""
        __tracebackhide__ = True
        self._named("interrupt", name, [source.name for source in self.legend.interrupts], self.interrupts)
        cycles, slot = self._worst_run(name, lambda rows: rows[:, COLUMN_CYCLES], INTERRUPT_RAN)
        self._compare(f"{name} cost", cycles, at_most, slot)

    def assert_latency(self, name: str, at_most: Duration) -> None:
        """Assert that no request of interrupt `name` waited over `at_most` for its handler's first instruction."""
        __tracebackhide__ = True
        self._named("interrupt", name, [source.name for source in self.legend.interrupts], self.interrupts)
        limit_ns = duration_ns(at_most, "limit")
        latency_ns, slot = self._worst_run(name, lambda rows: rows[:, COLUMN_LATENCY], INTERRUPT_RAN)
        if latency_ns > limit_ns:
            text = (
                f"{name} waited {duration_text(latency_ns)} for its service, at most {given_text(at_most)} are allowed:"
            )
            self._fail(text, slot)

    def _compare(self, what: str, cycles: int, at_most: Limit, slot: Slot) -> None:
        __tracebackhide__ = True
        allowed = at_most if isinstance(at_most, int) else self._limit_ns(at_most) * self.legend.cycles_per_ns
        if cycles > allowed:
            took = duration_text(cycles / self.legend.cycles_per_ns)
            self._fail(f"{what} {cycles:,} cycles ({took}), at most {_limit_text(at_most)} are allowed:", slot)

    def _limit_ns(self, limit: Limit) -> int:
        if isinstance(limit, bool) or not isinstance(limit, int | str) or (isinstance(limit, int) and limit < 0):
            raise UserError(f"limit {limit!r}: a whole number of cycles, or a time such as '450 us', is needed")
        return nanoseconds(limit, "limit") if isinstance(limit, str) else round(limit / self.legend.cycles_per_ns)

    def _fail(self, text: str, slot: Slot, limit_ns: int | None = None) -> None:
        __tracebackhide__ = True
        raise AssertionError(f"{self}: {text}\n\n{slot.picture(limit_ns)}")


def _by_name(rows: np.ndarray, names: list[str], limits: list[int]) -> dict[str, Statistics]:
    """Statistics of those that ran, by name; entries of one name count together."""
    found = {}
    for name in dict.fromkeys(names):
        numbers = [number for number, each in enumerate(names) if each == name]
        of_it = rows[np.isin(rows[:, COLUMN_NUMBER], numbers)]
        if len(of_it):
            found[name] = _statistics(name, of_it, limits[numbers[0]])
    return found


def _statistics(name: str, rows: np.ndarray, limit: int) -> Statistics:
    cycles = rows[:, COLUMN_CYCLES]
    return Statistics(
        name=name,
        calls=len(rows),
        least=int(cycles.min()),
        median=float(np.median(cycles)),
        most=int(cycles.max()),
        total=int(cycles.sum()),
        limit=limit,
        over_limit=int((cycles > limit).sum()) if limit else 0,
        most_items=int(rows[:, COLUMN_ITEMS].max()),
        latency_ns=int(rows[:, COLUMN_LATENCY].max()),
    )


def _time_ns(instant: Instant) -> int:
    return duration_ns(instant, "instant")


def _limit_text(limit: Limit) -> str:
    return limit if isinstance(limit, str) else f"{limit:,} cycles"
