"""Frames as rows, as in a robot's record (harness/records/logbook.py): the recent ones in memory, and their decoding.

row     time_ns, word 0 << 12 | flags << 4 | bus, word 1 << 29 | identifier
key     one kind of frame for counting: the identifier, EXTENDED with a long one; ERROR for error frames
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ranger_sim.can_bus import frame
from ranger_sim.can_bus.frame_bytes import data_of_words
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.packing import value_of_word
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.harness.records import logbook

ROW_WORDS = 3
EXTENDED, ERROR = 1 << 29, 1 << 30
FIELDS = {
    getattr(frame, name): name.removeprefix("FIELD_").replace("_", " ").lower()
    for name in dir(frame)
    if name.startswith("FIELD_")
}
# (identifier, flags, data) -> (name, decoded value)
Reading = Callable[[int, int, bytes], tuple[str, float | str | None]]


def nothing() -> Any:
    """No rows."""
    return np.empty((0, ROW_WORDS), np.int64)


def keys_of(rows: Any) -> Any:
    """The key of each frame."""
    flags = rows[:, 1] >> 4
    identifiers = (rows[:, 2] & 0x1FFFFFFF) | np.where(flags & FLAG_EXTENDED, EXTENDED, 0)
    return np.where(flags & FLAG_ERROR, ERROR, identifiers)


def counted(rows: Any) -> list[tuple[int, int]]:
    """(key, count) of each kind among frames."""
    keys, counts = np.unique(keys_of(rows), return_counts=True)
    return list(zip(keys.tolist(), counts.tolist(), strict=True))


class RecentFrames:
    """The last `most` frames of one bus, and the total count of each kind.

    The buffer holds twice as many; when it is full, the newer half moves to the front.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self.kept = np.empty((2 * most, ROW_WORDS), np.int64)
        self.used = 0
        self.total: dict[int, int] = {}

    def append(self, rows: Any) -> None:
        """Append frames later than all before. If they are earlier, time restarted, and older frames are dropped."""
        if not len(rows):
            return
        if self.used and rows[0, 0] < self.kept[self.used - 1, 0]:
            self.used = 0
            self.total.clear()
        for key, count in counted(rows):
            self.total[key] = self.total.get(key, 0) + count
        rows = rows[-self.most :]
        if self.used + len(rows) > len(self.kept):
            stay = min(self.most, self.used)
            self.kept[:stay] = self.kept[self.used - stay : self.used].copy()
            self.used = stay
        self.kept[self.used : self.used + len(rows)] = rows
        self.used += len(rows)

    def _place(self, until_ns: int | None) -> int:
        return self.used if until_ns is None else int(np.searchsorted(self.kept[: self.used, 0], until_ns, "right"))

    def until(self, until_ns: int | None, most: int) -> Any:
        """The last frames not later than `until_ns` (None: of all), up to `most` rows."""
        place = self._place(until_ns)
        return self.kept[max(0, place - most) : place]

    def within(self, first_ns: int, until_ns: int) -> int | None:
        """The number of frames later than `first_ns` and not later than `until_ns`; None if not kept."""
        if not self.used or first_ns < self.kept[0, 0]:
            return None
        return self._place(until_ns) - self._place(first_ns)

    def counts(self, until_ns: int | None, keys: list[int]) -> list[int | None]:
        """The count of each kind up to `until_ns`, since the first frame received."""
        later = keys_of(self.kept[self._place(until_ns) : self.used])
        return [self.total.get(key, 0) - int(np.count_nonzero(later == key)) for key in keys]


def listed(rows: Any, counts: Callable[[list[int]], list[int | None]], start_ns: int, read: Reading) -> list[dict]:
    """Frames as the page shows them, the newest first. counts: count of each kind up to the newest of them."""
    rows = np.ascontiguousarray(rows[::-1])
    keys = keys_of(rows).tolist()
    kinds = sorted(set(keys))
    count = dict(zip(kinds, counts(kinds), strict=True))
    columns = logbook.decoded(rows)
    shown = []
    for time_ns, key, number, flags, low, high in zip(
        columns["time_ns"].tolist(),
        keys,
        *(columns[name].tolist() for name in ("identifier", "flags", "word0", "word1")),
        strict=True,
    ):
        found: dict[str, Any] = {"time_s": (time_ns - start_ns) * 1e-9, "count": count[key]}
        if key == ERROR:
            field = FIELDS.get(low)
            found |= {"id": None, "name": f"error frame{f', {field}' if field else ''}", "value": None, "data": ""}
        else:
            data = data_of_words(flags, low & 0xFFFFFFFF, high & 0xFFFFFFFF)
            name, value = read(number, flags, data)
            found |= {"id": number, "name": name, "value": value, "data": data.hex(" ")}
            found["data"] = "remote" if flags & FLAG_REMOTE else found["data"]
        shown.append(found)
    return shown


def of_the_robot(number: int, flags: int, data: bytes) -> tuple[str, float | str | None]:
    """Decode a frame by the robot's own table: a variable and its value."""
    if flags & (FLAG_EXTENDED | FLAG_REMOTE) or number not in all_variables.TYPES:
        return "", None
    value = value_of_word(all_variables.TYPES[number], int.from_bytes(data[:4], "little"))
    return all_variables.NAMES[number], value if np.isfinite(value) else None


def unknown_source(number: int, flags: int, data: bytes) -> tuple[str, float | str | None]:
    """Decode a frame of an unknown bus: no name, no value."""
    return "", None
