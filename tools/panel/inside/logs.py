"""Frames of a bus in a log on disk, indexed in pieces, of which two are in memory."""

from __future__ import annotations

import bisect
import os
import pathlib
from typing import Any

import numpy as np

from ranger_sim.foundation import systems
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.panel.inside.candump_rows import rows_of
from ranger_sim.tools.panel.inside.frames import MOST_ROWS, counted, first_rows, last_frames, nothing

PIECE_BYTES = 1 << 20  # chosen by us: some seconds of a bus, read in some ten milliseconds
PIECES_KEPT = 2
Piece = tuple[int, int, Any]  # offset of its first byte and of the one after its last, rows


class LogFrames:
    """A candump log of one bus, in order of time. UserError if unreadable.

    Alternating `read` and `add` go through it; answers cover what was added so far. A frame's time is its microsecond
    in the log, the log's own resolution: up to 1 us before the time at which the bus had it.
    """

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        try:
            self.file = path.open("rb")
        except OSError as error:
            raise UserError(f"{path}: the frame log cannot be read ({error.strerror})") from None
        self.size = os.fstat(self.file.fileno()).st_size
        self.offset = 0  # everything before it was added
        self.newest_ns: int | None = None
        self.total: dict[int, int] = {}
        self.starts: list[tuple[int, int]] = []  # of each piece: bytes
        self.first_ns: list[int] = []
        self.before: list[int] = []  # frames, not rows, before each piece
        self.before_by_key: list[dict[int, int]] = []
        self.frames = 0
        self.cached: dict[int, Any] = {}

    def read(self) -> Piece | None:
        """The next piece; None after the last one. Changes no state, so that another thread may call it."""
        while self.offset < self.size:
            text = systems.read_at(self.file.fileno(), PIECE_BYTES, self.offset)
            end = self.offset + len(text)
            if end < self.size:
                text = text[: text.rfind(b"\n") + 1]
            if not text:
                raise UserError(f"{self.path}: a line of more than {PIECE_BYTES} bytes is none of a frame log")
            return self.offset, self.offset + len(text), self._rows_of(text)
        return None

    def _rows_of(self, text: bytes) -> Any:
        try:
            return rows_of(text)
        except UserError as error:
            raise UserError(f"{self.path}: {error}") from None

    def add(self, piece: Piece) -> None:
        """Add a piece that has been read."""
        begin, self.offset, rows = piece
        if not len(rows):
            return
        self.starts.append((begin, self.offset))
        self.first_ns.append(int(rows[0, 0]))
        self.newest_ns = int(rows[-1, 0])
        self.before.append(self.frames)
        self.before_by_key.append(dict(self.total))
        self.frames += int(np.count_nonzero(first_rows(rows)))
        for key, count in counted(rows):
            self.total[key] = self.total.get(key, 0) + count
        self._keep(len(self.starts) - 1, rows)

    def _keep(self, number: int, rows: Any) -> None:
        self.cached[number] = rows
        while len(self.cached) > PIECES_KEPT:
            del self.cached[next(iter(self.cached))]

    def _piece(self, number: int) -> Any:
        rows = self.cached.pop(number, None)
        if rows is None:
            begin, end = self.starts[number]
            rows = self._rows_of(systems.read_at(self.file.fileno(), end - begin, begin))
        self._keep(number, rows)
        return rows

    def _place(self, until_ns: int | None) -> tuple[int, int]:
        """(number of the piece, its rows that are not later); -1: all are later."""
        number = len(self.starts) - 1 if until_ns is None else bisect.bisect_right(self.first_ns, until_ns) - 1
        if number < 0:
            return -1, 0
        rows = self._piece(number)
        return number, len(rows) if until_ns is None else int(np.searchsorted(rows[:, 0], until_ns, "right"))

    def _is_open(self, until_ns: int | None) -> bool:
        """True if the part not yet read may contain frames up to this time."""
        is_over = self.newest_ns is not None and until_ns is not None and until_ns < self.newest_ns
        return self.offset < self.size and not is_over

    def until(self, until_ns: int | None, most: int) -> Any:
        """The rows of the last frames not later than `until_ns` (None: of all), up to `most` frames."""
        number, end = self._place(until_ns)
        if number < 0:
            return nothing()
        found = [last_frames(self._piece(number)[max(0, end - (most + 1) * MOST_ROWS) : end], most)]
        while (left := most - sum(int(np.count_nonzero(first_rows(each))) for each in found)) > 0 and number > 0:
            number -= 1
            found.append(last_frames(self._piece(number), left))
        return np.concatenate(found[::-1])

    def within(self, first_ns: int, until_ns: int) -> int | None:
        """The number of frames later than `first_ns` and not later than `until_ns`; None if not in the log."""
        if not self.starts or first_ns < self.first_ns[0] or self._is_open(until_ns):
            return None
        (early, early_rows), (late, late_rows) = self._place(first_ns), self._place(until_ns)
        return self._frames_up_to(late, late_rows) - self._frames_up_to(early, early_rows)

    def _frames_up_to(self, number: int, rows: int) -> int:
        """The number of frames before these rows of a piece have ended."""
        return self.before[number] + int(np.count_nonzero(first_rows(self._piece(number)[:rows])))

    def counts(self, until_ns: int | None, keys: list[int]) -> list[int | None]:
        """The count of each kind up to `until_ns`, since the log's beginning; None if not read that far."""
        if self._is_open(until_ns):
            return [None] * len(keys)
        number, end = self._place(until_ns)
        if number < 0:
            return [0] * len(keys)
        there = dict(counted(self._piece(number)[:end]))
        before = self.before_by_key[number]
        return [before.get(key, 0) + there.get(key, 0) for key in keys]

    def close(self) -> None:
        """Close the file."""
        self.file.close()
