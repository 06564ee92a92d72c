"""Errors of boards by code: count, times, and count up to a given time; separate from those of a healthy walk."""

from __future__ import annotations

import array
import bisect
from collections.abc import Iterator
from typing import Any

import numpy as np

from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.packing import parts_of_error_word
from ranger_sim.harness import normal_errors
from ranger_sim.ranger.names import RANGER
from ranger_sim.tools.panel.inside.frames import keys_of
from ranger_sim.tools.panel.source import error_rows

# {identifier of the variable in which a board reports its errors: its name}
ERRORS = {
    all_variables.ID_OF[name]: name.removeprefix("ERROR_")
    for name in all_variables.ID_OF
    if name.startswith("ERROR_") and name.removeprefix("ERROR_") in all_variables.BOARD_NAMES.values()
}
ON_NO_BUS = ("CSR", "MB")  # errors of the router and the main brain themselves reach the table without a bus
MOST_TIMES = 100_000  # kept of each error; chosen by us: 1.6 MB, an hour of an error 28 times a second


class ErrorList:
    """Errors by board and code."""

    def __init__(self) -> None:
        self.rows: dict[tuple[int, int], dict[str, Any]] = {}
        self.times: dict[tuple[int, int], tuple[array.array[float], array.array[int]]] = {}  # times, counts then

    def note(self, word: int, time_s: float) -> None:
        """Record an error word at this time of the robot."""
        code, board, count = parts_of_error_word(word)
        if code == 0:
            return
        row = self.rows.setdefault((board, code), {"first_s": time_s, "count": 0})
        row["count"] += max(1, count)
        row["last_s"] = time_s
        times, counts = self.times.setdefault((board, code), (array.array("d"), array.array("q")))
        times.append(time_s)
        counts.append(row["count"])
        if len(times) > 2 * MOST_TIMES:
            del times[:MOST_TIMES], counts[:MOST_TIMES]

    def note_frames(self, rows: Any, start_ns: int) -> None:
        """Record the error words among frames (rows of a robot's bus)."""
        for row in rows[np.isin(keys_of(rows), list(ERRORS))]:
            self.note(int(row[1]) >> 12, (int(row[0]) - start_ns) * 1e-9)

    def content(self, now_s: float, at: float | None = None) -> list[dict[str, Any]]:
        """The rows for the page, in the order of their first times, so that a row keeps its place.

        until: the count up to `at`; None if that is not kept.
        """
        found = []
        for (board, code), row in self.rows.items():
            name, text = error_rows().get(code, (f"error {code}", "not in the table"))
            whose = all_variables.BOARD_NAMES.get(board, f"board {board}")
            normal = row["count"] <= normal_errors.most_normal(RANGER, whose, code, now_s, True)
            until = None if at is None else self._until((board, code), at)
            found.append({"board": whose, "name": name, "text": text, "normal": normal, "until": until, **row})
        return sorted(found, key=lambda row: row["first_s"])

    def _until(self, key: tuple[int, int], at: float) -> int | None:
        times, counts = self.times[key]
        place = bisect.bisect_right(times, at)
        if place == 0:
            return 0 if at < self.rows[key]["first_s"] else None
        return counts[place - 1]


def changes(words: Any, times: Any, before: int) -> Iterator[tuple[int, Any]]:
    """(word, time) of every change to a word that reports an error."""
    for place in np.flatnonzero(np.diff(words, prepend=before)):
        if words[place]:
            yield int(words[place]), times[place]
