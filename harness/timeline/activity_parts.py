# cython: boundscheck=False, wraparound=False
# (every index below is a column of a whole row, or is below the number of rows that `count` has found)
"""Parts the rows of an activity log by what they are of, into columns."""

import array
from typing import Final

import cython

from ranger_sim.firmware_sim.activity import (
    ACTIVITY_COLUMNS,
    COLUMN_CYCLES,
    COLUMN_END,
    COLUMN_KIND,
    COLUMN_LATENCY,
    COLUMN_NUMBER,
    COLUMN_START,
    INTERRUPT_RAN,
    MAIN_LOOP_RAN,
    TASK_RAN,
    WAIT_RAN,
)
from ranger_sim.foundation.numbers import integers

# what a part's rows are of
TASKS: Final = 0
SERVICES: Final = 1
FAST: Final = 2
TURNS: Final = 3
OTHERS: Final = 4  # as they are
PARTS: Final = 5
# columns of a part, but of OTHERS
START: Final = 0
END: Final = 1
NUMBER: Final = 2
CYCLES: Final = 3
LATENCY: Final = 4
COLUMNS: Final = 5


@cython.final
@cython.cclass
class ActivityParts:
    """Tasks and waits, slow and fast interrupts, turns of the main loop; and the rows of slots.

    `windows`: begin and end (ns) of each time, both included, in which a row must end. `fast`: of each interrupt
    whether it is; `lists`: of each task whether it is an occasional list, whose row is left out where it directly
    follows that of its entry. First `count` all rows, then `take` them in the same order.
    """

    windows: cython.longlong[::1]
    fast: cython.longlong[::1]
    lists: cython.longlong[::1]
    sizes: cython.longlong[::1]
    counts: cython.longlong[::1]
    kept: list
    tasks: cython.p_longlong
    services: cython.p_longlong
    fasts: cython.p_longlong
    turns: cython.p_longlong
    others: cython.p_longlong
    last_start: cython.longlong
    last_end: cython.longlong

    def __init__(self, windows, fast, lists) -> None:
        self.windows = array.array("q", windows)
        self.fast = array.array("q", [*fast, 0])
        self.lists = array.array("q", [*lists, 0])
        self.sizes = integers(PARTS)
        self.counts = integers(PARTS)
        self.kept = []
        self.last_start, self.last_end = -1, -1

    @cython.cfunc
    def _part(self, kind: cython.longlong, number: cython.longlong) -> cython.longlong:
        if kind == TASK_RAN or kind == WAIT_RAN:
            return TASKS
        if kind == INTERRUPT_RAN:
            return FAST if self.fast[number] else SERVICES
        return TURNS if kind == MAIN_LOOP_RAN else OTHERS

    @cython.cfunc
    def _wanted(self, time: cython.longlong) -> cython.bint:
        i: cython.longlong
        for i in range(len(self.windows) - 2, -2, -2):
            if self.windows[i] <= time <= self.windows[i + 1]:
                return True
        return False

    @cython.ccall
    def count(self, rows: cython.const[cython.longlong][::1]) -> None:
        """Count `rows`, whose parts need places."""
        at: cython.longlong
        for at in range(0, len(rows), ACTIVITY_COLUMNS):
            if self._wanted(rows[at + COLUMN_END]):
                self.sizes[self._part(rows[at + COLUMN_KIND], rows[at + COLUMN_NUMBER])] += 1

    def allocate(self, made) -> None:
        """Call `made(rows, columns)` for the flat array of each part, between `count` and `take`."""
        self.kept = [made(self.sizes[part], ACTIVITY_COLUMNS if part == OTHERS else COLUMNS) for part in range(PARTS)]
        tasks: cython.longlong[::1] = self.kept[TASKS]
        services: cython.longlong[::1] = self.kept[SERVICES]
        fasts: cython.longlong[::1] = self.kept[FAST]
        turns: cython.longlong[::1] = self.kept[TURNS]
        others: cython.longlong[::1] = self.kept[OTHERS]
        self.tasks = cython.address(tasks[0]) if cython.compiled else tasks
        self.services = cython.address(services[0]) if cython.compiled else services
        self.fasts = cython.address(fasts[0]) if cython.compiled else fasts
        self.turns = cython.address(turns[0]) if cython.compiled else turns
        self.others = cython.address(others[0]) if cython.compiled else others

    @cython.ccall
    def take(self, given: cython.const[cython.longlong][::1]) -> None:
        """Part the rows `given`."""
        at: cython.longlong
        column: cython.longlong
        part: cython.longlong
        place: cython.longlong
        rows: cython.p_longlong  # a memoryview, as an argument of each call below, would be 208 bytes
        rows = cython.cast(cython.p_longlong, cython.address(given[0])) if cython.compiled else given
        for at in range(0, len(given), ACTIVITY_COLUMNS):
            if not self._wanted(rows[at + COLUMN_END]):
                continue
            part = self._part(rows[at + COLUMN_KIND], rows[at + COLUMN_NUMBER])
            place = self.counts[part]
            if part == TASKS:
                if self._doubled(rows[at + COLUMN_START], rows[at + COLUMN_END], rows[at + COLUMN_NUMBER]):
                    continue
                self._keep(self.tasks, self.sizes[TASKS], place, rows, at)
            elif part == SERVICES:
                self._keep(self.services, self.sizes[SERVICES], place, rows, at)
            elif part == FAST:
                self._keep(self.fasts, self.sizes[FAST], place, rows, at)
            elif part == TURNS:
                self._keep(self.turns, self.sizes[TURNS], place, rows, at)
            else:
                for column in range(ACTIVITY_COLUMNS):
                    self.others[place * ACTIVITY_COLUMNS + column] = rows[at + column]
            self.counts[part] = place + 1

    @cython.cfunc
    def _doubled(self, start: cython.longlong, end: cython.longlong, number: cython.longlong) -> cython.bint:
        """Whether a task is the list of the entry before it."""
        same: cython.bint = start == self.last_start and end == self.last_end and self.lists[number] != 0
        self.last_start, self.last_end = start, end
        return same

    @cython.cfunc
    def _keep(
        self,
        columns: cython.p_longlong,
        size: cython.longlong,
        place: cython.longlong,
        rows: cython.p_longlong,
        at: cython.longlong,
    ) -> cython.longlong:
        columns[place] = rows[at + COLUMN_START]
        columns[END * size + place] = rows[at + COLUMN_END]
        columns[NUMBER * size + place] = rows[at + COLUMN_NUMBER]
        columns[CYCLES * size + place] = rows[at + COLUMN_CYCLES]
        columns[LATENCY * size + place] = rows[at + COLUMN_LATENCY]
        return place
