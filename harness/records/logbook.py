"""The records that a run keeps for its files: none, the last seconds, or all (spooled to disk)."""

import collections
import os
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.row_stream import FD_FLAGS_SHIFT, FURTHER, FrameStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.records.recorder import Recorder

WINDOW_S = 10.0  # default window of the logs: some 16 steps
READ_ROWS = 4096  # of a spooled stream at a time
ROW_BYTES = 24  # of a stream of frames


def decoded(rows: Any) -> dict:
    """Frames of rows of a frame stream (foundation/row_stream.py): dict of arrays, as in `Logbook.frames`.

    Of a CAN FD frame word0 and word1 are its first eight bytes.
    """
    rows = rows[rows[:, 1] & FURTHER == 0]
    first, second, third = rows[:, 0], rows[:, 1], rows[:, 2]
    return {
        "time_ns": first,
        "bus": second & 15,
        "flags": (second >> 4) & 255 | (second >> FD_FLAGS_SHIFT & 7) << 8,
        "word0": second >> 12 & 0xFFFFFFFF,
        "identifier": third & 0x1FFFFFFF,
        "word1": third >> 29,
    }


def _further_rows(spool: Any) -> bytes:
    """What follows in a spooled stream of frames and belongs to the frame before."""
    found = b""
    while (row := spool.read(ROW_BYTES)) and int.from_bytes(row[8:16], "little") & FURTHER:
        found += row
    spool.seek(-len(row), os.SEEK_CUR)
    return found


class Logbook:
    """Blocks of the recorder's streams.

    mode: "none" keeps nothing, "window" the last `window_s` seconds in memory, "full" everything in
    unnamed temporary files (so that nothing is left behind however the process ends).
    """

    def __init__(self, recorder: Recorder, mode: str, window_s: float = WINDOW_S) -> None:
        if mode not in ("none", "window", "full"):
            raise UserError(f"log mode is {mode!r}, allowed are full, window, none")
        self.mode = mode
        self.window_ns = int(window_s * 1e9)
        self.streams = recorder.streams()
        self.blocks: dict[str, collections.deque[tuple[int, bytes]]] = {
            name: collections.deque() for name in self.streams
        }
        self.spools: dict[str, Any] = {}
        self.buses = len(recorder.frames)
        if mode == "none":
            return
        for name, stream in self.streams.items():
            if mode == "full":
                self.spools[name] = tempfile.TemporaryFile(prefix="ranger-sim-")  # noqa: SIM115
                stream.sink = self._spooler(name)
            else:
                stream.sink = self._window(name)

    def _window(self, name: str) -> Callable[[int, bytes], None]:
        blocks = self.blocks[name]

        def keep(last_time_ns: int, block: bytes) -> None:
            blocks.append((last_time_ns, block))
            while blocks[0][0] < last_time_ns - self.window_ns:
                blocks.popleft()

        return keep

    def _spooler(self, name: str) -> Callable[[int, bytes], None]:
        spool = self.spools[name]

        def write(_last_time_ns: int, block: bytes) -> None:
            spool.write(block)

        return write

    def listen(self, name: str, taker: Callable[[Any], None]) -> None:
        """Pass the rows of a stream to `taker` as well from now on, block by block, as they are recorded."""
        stream, kept = self.streams[name], self.streams[name].sink

        def both(last_time_ns: int, block: bytes) -> None:
            if kept is not None:
                kept(last_time_ns, block)
            taker(self._as_rows(name, block))

        stream.sink = both

    def flush(self) -> None:
        """Pass on what waits in the streams' blocks."""
        for stream in self.streams.values():
            stream.flush()

    def kept(self, name: str) -> Iterator[Any]:
        """The rows of a stream that are kept, some thousand at a time."""
        stream = self.streams[name]
        self.flush()
        if self.mode == "full":
            spool = self.spools[name]
            spool.seek(0)
            while block := spool.read(8 * stream.columns * READ_ROWS):
                if isinstance(stream, FrameStream):
                    block += _further_rows(spool)
                yield self._as_rows(name, block)
            spool.seek(0, 2)
        else:
            begin_ns = max((each.last_time_ns for each in self.streams.values()), default=0) - self.window_ns
            for _, block in self.blocks[name]:
                rows = self._as_rows(name, block)
                times_ns = rows[:, 0] * 1e9 if stream.is_real else rows[:, 0]
                yield rows[times_ns >= begin_ns]

    def _as_rows(self, name: str, block: bytes) -> Any:
        stream = self.streams[name]
        return np.frombuffer(block, dtype=np.float64 if stream.is_real else np.int64).reshape(-1, stream.columns)

    @property
    def reach_ns(self) -> int:
        """How far back its records reach, ns."""
        return {"none": 0, "window": self.window_ns}.get(self.mode, NEVER)

    @property
    def records_words(self) -> bool:
        """True when the variables are kept (the recorder then samples the data table)."""
        return self.mode != "none"

    def _rows(self, name: str) -> Any:
        stream = self.streams[name]
        stream.flush()
        if self.mode == "full":
            spool = self.spools[name]
            spool.flush()
            spool.seek(0)
            rows = self._as_rows(name, spool.read())
            spool.seek(0, 2)
        else:
            rows = self._as_rows(name, b"".join(block for _, block in self.blocks[name]))
        if self.mode == "window" and len(rows):
            times_ns = rows[:, 0] * 1e9 if stream.is_real else rows[:, 0]
            rows = rows[times_ns >= times_ns[-1] - self.window_ns]
        return rows

    def frames(self) -> dict:
        """Frames seen on the buses: dict of arrays time_ns, bus (0..3), identifier, flags, word0, word1.

        In order of time; at one time the lower bus comes first.
        """
        rows = np.concatenate([self._rows(f"can{number}") for number in range(1, self.buses + 1)])
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        if self.mode == "window" and len(rows):
            rows = rows[rows[:, 0] >= rows[-1, 0] - self.window_ns]
        return decoded(rows)

    def samples(self) -> Any:
        """Samples of the plant: array (rows, columns), time in s in column 0."""
        return self._rows("samples")

    def words(self) -> tuple:
        """(time_ns, words): the main brain's table, int64 arrays (rows,) and (rows, variables)."""
        rows = self._rows("words")
        return rows[:, 0], rows[:, 1:]

    def close(self) -> None:
        """Close the spool files."""
        for spool in self.spools.values():
            spool.close()
