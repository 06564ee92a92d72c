"""What a board's activity log (firmware_sim/activity.py) has written since a recording began, as arrays."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
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
    INTERRUPT_RAN,
    MAIN_LOOP_RAN,
    SLOT_BEGAN,
    SLOT_ENDED,
    SLOT_OVERRAN,
    TASK_DROPPED,
    TASK_RAN,
    WAIT_RAN,
)
from ranger_sim.firmware_sim.legend import Legend

# 256 MiB of one board, a minute of a motor board that walks (chosen by us): older rows are discarded, and reported
MOST_ROWS = 4 * 1024 * 1024
NOT_THROUGH = -1
EXECUTIONS = (TASK_RAN, WAIT_RAN, INTERRUPT_RAN, MAIN_LOOP_RAN)


@dataclasses.dataclass(frozen=True)
class Slots:
    """The complete slots of a recording, as arrays of equal length in order of time; times since power-up, ns.

    `cycles` from tick to end, interrupts included; `end` its end. A slot that was dropped as a whole has 0 cycles and
    ends at its start; where the last task of an overrun slot is not finished yet, both cover the time until the tick
    that found it. `first` ... `last`: the part of `Recording.rows` that ran from its tick to the next one.
    `place`: among all slots that began (`Recording.slot_of`).
    """

    place: np.ndarray
    number: np.ndarray
    row: np.ndarray
    start: np.ndarray
    end: np.ndarray
    cycles: np.ndarray
    overran: np.ndarray
    first: np.ndarray
    last: np.ndarray

    def __len__(self) -> int:
        return len(self.number)


class Recording:
    """Everything that `board` does from now on. `rows`: an array of ACTIVITY_COLUMNS columns, sorted by start.

    `find_log` returns its present log, if that is not on `board`: a board may move into another process. `find_board`:
    returns the present board, where another may replace it.
    `origin_ns`: power-up of the robot; times count from there.
    `slot_of`: to which slot each row belongs, -1 for what ran before the first.
    """

    def __init__(
        self,
        board: Any,
        origin_ns: int = 0,
        begun_ns: int = 0,
        most_rows: int = MOST_ROWS,
        find_log: Callable[[], Any] | None = None,
        find_board: Callable[[], Any] | None = None,
    ) -> None:
        self.find_board = find_board if find_board is not None else lambda: board
        self.find_log = find_log if find_log is not None else board.activity
        self.origin_ns = origin_ns
        self.begun_ns = begun_ns
        self.most_rows = most_rows
        self.given_up = 0
        self.lost_before_us = 0  # rows that a board in another process discarded before the first request
        self.forgotten = 0  # of them, before `forget`
        self.blocks: list[bytes] = []
        self.kept = 0
        self.rows = np.empty((0, ACTIVITY_COLUMNS), dtype=np.int64)
        self.slots = self._slots()
        self.slot_of = np.empty(0, dtype=np.int64)
        self.decoded = 0
        self.find_log().add_sink(self._take)

    def legend(self) -> Legend:
        """Names, costs and limits as they are now."""
        legend: Legend = self.find_board().legend()
        return legend

    def forget(self) -> None:
        """Discard what was recorded so far."""
        self.update()
        self.blocks.clear()
        self.kept = 0
        self.given_up = 0
        self.forgotten = self.lost_before_us
        self.decoded = -1

    def _take(self, time_ns: int, rows: bytes) -> None:
        self.blocks.append(rows)
        self.kept += len(rows) // (8 * ACTIVITY_COLUMNS)
        while self.kept > self.most_rows and len(self.blocks) > 1:
            given_up = len(self.blocks.pop(0)) // (8 * ACTIVITY_COLUMNS)
            self.kept -= given_up
            self.given_up += given_up

    def reaching_into(self, place: int, start_ns: int) -> np.ndarray:
        """Of the rows before `place`: tasks, interrupts and turns that began before `start_ns` and ended after it."""
        rows = self.rows[:place]
        chosen = np.isin(rows[:, COLUMN_KIND], EXECUTIONS) & (rows[:, COLUMN_START] < start_ns)
        return rows[chosen & (rows[:, COLUMN_END] > start_ns)]

    @property
    def lost(self) -> int:
        """Rows that were discarded for newer ones since the beginning, or since `forget`."""
        return self.given_up + self.lost_before_us - self.forgotten

    def update(self) -> Slots:
        """Bring `rows` and `slots` up to now."""
        log = self.find_log()
        log.flush()
        self.lost_before_us = getattr(log, "lost", 0)
        if self.decoded != self.kept + self.given_up:
            self.decoded = self.kept + self.given_up
            rows = np.frombuffer(b"".join(self.blocks), dtype=np.int64).reshape(-1, ACTIVITY_COLUMNS).copy()
            rows[:, COLUMN_START] -= self.origin_ns
            rows[:, COLUMN_END] -= self.origin_ns
            # of two that start together: a slot's begin first, then the outer before the inner
            began = rows[:, COLUMN_KIND] != SLOT_BEGAN
            order = np.lexsort((-rows[:, COLUMN_END], began, rows[:, COLUMN_START]))
            self.rows = rows[order]
            self.slots = self._slots()
        return self.slots

    def of_kind(self, *kinds: int) -> np.ndarray:
        """Places in `rows` of the rows of these kinds."""
        return np.flatnonzero(np.isin(self.rows[:, COLUMN_KIND], kinds))

    def _slots(self) -> Slots:
        """Which rows belong to which slot: those of its number, and what ran from its tick to the next one."""
        rows = self.rows
        kind = rows[:, COLUMN_KIND]
        began = rows[kind == SLOT_BEGAN]
        numbers = began[:, COLUMN_NUMBER]
        count = len(numbers)
        cycles = np.full(count, NOT_THROUGH, dtype=np.int64)
        end = began[:, COLUMN_START].copy()
        overran = np.zeros(count, dtype=bool)

        def of_known(what: int) -> np.ndarray:
            return rows[(kind == what) & np.isin(rows[:, COLUMN_START], began[:, COLUMN_START])]

        def places(of: np.ndarray) -> np.ndarray:
            return np.searchsorted(began[:, COLUMN_START], of[:, COLUMN_START])

        late = of_known(SLOT_OVERRAN)
        overran[places(late)] = True
        listed = began[places(late), COLUMN_ITEMS]
        whole = late[:, COLUMN_ITEMS] == listed
        ticks_cycles = (late[:, COLUMN_END] - late[:, COLUMN_START]) * self.legend().cycles_per_ns if len(late) else 0
        cycles[places(late)] = np.where(whole, 0, ticks_cycles)
        end[places(late)] = np.where(whole, late[:, COLUMN_START], late[:, COLUMN_END])
        ended = of_known(SLOT_ENDED)
        cycles[places(ended)] = ended[:, COLUMN_CYCLES]
        end[places(ended)] = ended[:, COLUMN_END]
        self.slot_of = np.searchsorted(began[:, COLUMN_START], rows[:, COLUMN_START], side="right") - 1
        dropped = kind == TASK_DROPPED  # exactly at the tick of the next one
        self.slot_of[dropped] = np.searchsorted(began[:, COLUMN_START], rows[dropped, COLUMN_START], side="left") - 1
        starts = np.searchsorted(rows[:, COLUMN_START], began[:, COLUMN_START], side="left")
        lasts = np.append(starts[1:], len(rows)) if count else starts
        through = cycles != NOT_THROUGH
        return Slots(
            place=np.flatnonzero(through),
            number=numbers[through],
            row=began[through, COLUMN_ROW],
            start=began[through, COLUMN_START],
            end=end[through],
            cycles=cycles[through],
            overran=overran[through],
            first=starts[through],
            last=lasts[through],
        )
