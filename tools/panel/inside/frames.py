"""Frames as rows, as in a robot's record (foundation/row_stream.py): the recent ones in memory, and their decoding.

row     time_ns, word 0 << 12 | flags << 4 | bus, word 1 << 29 | identifier; of a CAN FD frame with more than eight
        bytes further rows follow, marked by FURTHER
key     one kind of frame for counting: the identifier, EXTENDED with a long one; ERROR for error frames
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ranger_sim.can_bus import frame
from ranger_sim.can_bus.fd_frame import fd_data_length
from ranger_sim.can_bus.frame_bytes import data_of_words
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.packing import value_of_word
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ERROR, FLAG_ESI, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE
from ranger_sim.foundation.row_stream import FD_FLAGS_SHIFT, FURTHER
from ranger_sim.harness.records import logbook

ROW_WORDS = 3
MOST_ROWS = 8  # of a frame: 64 bytes
EXTENDED, ERROR = 1 << 29, 1 << 30
NO_KEY = -1  # of a further row
FD_FLAGS = {FLAG_FD: "FD", FLAG_BRS: "BRS", FLAG_ESI: "ESI"}
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


def rows_of_frame(time_ns: int, identifier: int, flags: int, low: int, high: int) -> list[tuple[int, int, int]]:
    """The rows of one frame; `high` of a CAN FD frame holds all bytes from the fifth on."""
    if not flags & FLAG_FD:
        return [(time_ns, low << 12 | flags << 4, high << 29 | identifier)]
    data = data_of_words(flags, low, high)
    found = []
    for at in range(0, max(len(data), 1), 8):
        first, second = (int.from_bytes(data[at + part : at + part + 4], "little") for part in (0, 4))
        marks = FURTHER if at else (flags & 0xFF) << 4 | flags >> 8 << FD_FLAGS_SHIFT
        found.append((time_ns, first << 12 | marks, second << 29 | identifier))
    return found


def first_rows(rows: Any) -> Any:
    """Mask of the rows with which a frame begins."""
    return rows[:, 1] & FURTHER == 0


def keys_of(rows: Any) -> Any:
    """The key of each frame; NO_KEY of a further row."""
    flags = rows[:, 1] >> 4
    identifiers = (rows[:, 2] & 0x1FFFFFFF) | np.where(flags & FLAG_EXTENDED, EXTENDED, 0)
    return np.where(first_rows(rows), np.where(flags & FLAG_ERROR, ERROR, identifiers), NO_KEY)


def counted(rows: Any) -> list[tuple[int, int]]:
    """(key, count) of each kind among frames."""
    keys, counts = np.unique(keys_of(rows), return_counts=True)
    return [(key, count) for key, count in zip(keys.tolist(), counts.tolist(), strict=True) if key != NO_KEY]


def last_frames(rows: Any, most: int) -> Any:
    """The rows of the last frames, up to `most` of them; a frame of which only further rows are there is left out."""
    begins = np.flatnonzero(first_rows(rows[-most * MOST_ROWS :])) + max(0, len(rows) - most * MOST_ROWS)
    return rows[begins[-most] if len(begins) >= most else begins[0] :] if len(begins) else rows[:0]


class RecentFrames:
    """The last `most` rows of the frames of one bus, and the total count of each kind.

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
        """The rows of the last frames not later than `until_ns` (None: of all), up to `most` frames."""
        place = self._place(until_ns)
        return last_frames(self.kept[max(0, place - (most + 1) * MOST_ROWS) : place], most)

    def within(self, first_ns: int, until_ns: int) -> int | None:
        """The number of frames later than `first_ns` and not later than `until_ns`; None if not kept."""
        if not self.used or first_ns < self.kept[0, 0]:
            return None
        return int(np.count_nonzero(first_rows(self.kept[self._place(first_ns) : self._place(until_ns)])))

    def counts(self, until_ns: int | None, keys: list[int]) -> list[int | None]:
        """The count of each kind up to `until_ns`, since the first frame received."""
        later = keys_of(self.kept[self._place(until_ns) : self.used])
        return [self.total.get(key, 0) - int(np.count_nonzero(later == key)) for key in keys]


def listed(rows: Any, counts: Callable[[list[int]], list[int | None]], start_ns: int, read: Reading) -> list[dict]:
    """Frames as the page shows them, the newest first. counts: count of each kind up to the newest of them.

    rows: of whole frames, the oldest first.
    """
    begins = np.flatnonzero(first_rows(rows))
    keys = keys_of(rows[begins]).tolist()
    kinds = sorted(set(keys))
    count = dict(zip(kinds, counts(kinds), strict=True))
    columns = {name: column.tolist() for name, column in logbook.decoded(rows).items()}
    shown = []
    for place, (begin, key) in enumerate(zip(begins, keys, strict=True)):
        end = begins[place + 1] if place + 1 < len(begins) else len(rows)
        number, flags = columns["identifier"][place], columns["flags"][place]
        time_s = (columns["time_ns"][place] - start_ns) * 1e-9
        found: dict[str, Any] = {"time_s": time_s, "count": count[key]}
        if key == ERROR:
            field = FIELDS.get(columns["word0"][place])
            found |= {"id": None, "name": f"error frame{f', {field}' if field else ''}", "value": None, "data": ""}
        else:
            data = data_of_rows(rows[begin:end], flags)
            name, value = read(number, flags, data)
            found |= {"id": number, "name": name, "value": value, "data": data.hex(" ")}
            found["data"] = "remote" if flags & FLAG_REMOTE else found["data"]
            if flags & FLAG_FD:
                found |= {"fd": " ".join(text for flag, text in FD_FLAGS.items() if flags & flag), "bytes": len(data)}
        shown.append(found)
    return shown[::-1]


def data_of_rows(rows: Any, flags: int) -> bytes:
    """The data of one frame, from all its rows."""
    if not flags & FLAG_FD:
        return data_of_words(flags, int(rows[0, 1]) >> 12 & 0xFFFFFFFF, int(rows[0, 2]) >> 29 & 0xFFFFFFFF)
    words = np.stack([rows[:, 1] >> 12, rows[:, 2] >> 29], axis=1).astype(np.uint32)
    return words.astype("<u4").tobytes()[: fd_data_length(flags)]


def of_the_robot(number: int, flags: int, data: bytes) -> tuple[str, float | str | None]:
    """Decode a frame by the robot's own table: a variable and its value."""
    if flags & (FLAG_EXTENDED | FLAG_REMOTE | FLAG_FD) or number not in all_variables.TYPES:
        return "", None
    value = value_of_word(all_variables.TYPES[number], int.from_bytes(data[:4], "little"))
    return all_variables.NAMES[number], value if np.isfinite(value) else None


def unknown_source(number: int, flags: int, data: bytes) -> tuple[str, float | str | None]:
    """Decode a frame of an unknown bus: no name, no value."""
    return "", None
