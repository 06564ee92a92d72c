"""Keeps the blocks of a row stream: those of the last seconds in memory, or all of them in an unnamed file."""

import collections
import contextlib
import mmap
import tempfile
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np


class RowStore:
    """The sink of one `RowStream`. `columns` of a row; `last_ns`: how much of the past is kept, None: all of it.

    With `last_ns` None the rows are in a temporary file, so that nothing is left behind however the process ends.
    `before`: the previous sink of the blocks, which continues to receive them. `wanted(begin_ns, end_ns)`: whether a
    block of this time is kept although it is older.
    """

    def __init__(
        self,
        columns: int,
        last_ns: int | None,
        before: Callable[[int, bytes], None] | None = None,
        wanted: Callable[[int, int], bool] | None = None,
    ) -> None:
        self.columns = columns
        self.last_ns = last_ns
        self.before = before
        self.wanted = wanted
        self.begin_ns = 0  # of the oldest block that is not dropped for its age yet
        self.held: list[bytes] = []
        self.blocks: collections.deque[tuple[int, bytes]] = collections.deque()
        self.spool: Any = None
        self.failure: OSError | None = None  # of the spool: the disk is full
        if last_ns is None:
            self.spool = tempfile.TemporaryFile(prefix="ranger-sim-timeline-")  # noqa: SIM115
            weakref.finalize(self, discard, self.spool)  # also of a timeline that is never closed

    def take(self, last_time_ns: int, block: bytes) -> None:
        """Keep a block whose last row is of `last_time_ns`, and drop blocks that are too old."""
        if self.before is not None:
            self.before(last_time_ns, block)
        if self.spool is not None:
            self._spool(block)
            return
        assert self.last_ns is not None
        self.blocks.append((last_time_ns, block))
        while self.blocks[0][0] < last_time_ns - self.last_ns:
            end_ns, old = self.blocks.popleft()
            if self.wanted is not None and self.wanted(self.begin_ns, end_ns):
                self.held.append(old)
            self.begin_ns = end_ns

    def _spool(self, block: bytes) -> None:
        """Write a block; the run goes on without a timeline where the disk is full, and `rows` reports it."""
        if self.failure is None:
            try:
                self.spool.write(block)
                self.spool.flush()
            except OSError as error:
                self.failure = error

    def rows(self, kind: type = np.int64) -> np.ndarray:
        """Everything kept: array (rows, columns). OSError where the file could not take everything."""
        parts = self.parts(kind)
        return parts[0] if len(parts) == 1 else np.concatenate([np.empty((0, self.columns), dtype=kind), *parts])

    def parts(self, kind: type = np.int64) -> list[np.ndarray]:
        """The same as arrays that follow one another, without a copy."""
        if self.failure is not None:
            raise OSError(self.failure.errno, self.failure.strerror, f"rows of the timeline in {tempfile.gettempdir()}")
        blocks: list[Any] = [*self.held, *(block for _, block in self.blocks)]
        if self.spool is not None and self.spool.tell():
            blocks = [mmap.mmap(self.spool.fileno(), 0, access=mmap.ACCESS_READ)]
        return [np.frombuffer(block, dtype=kind).reshape(-1, self.columns) for block in blocks]

    @property
    def size(self) -> int:
        """Bytes kept."""
        if self.spool is not None:
            return int(self.spool.tell())
        return sum(map(len, self.held)) + sum(len(block) for _, block in self.blocks)

    def close(self) -> None:
        """Close the file."""
        if self.spool is not None:
            discard(self.spool)
        self.blocks.clear()
        self.held.clear()


def discard(file: Any) -> None:
    """Close a file whose content is not needed; what it still buffers may not fit on a full disk, as `rows` reports."""
    with contextlib.suppress(OSError):
        file.close()
