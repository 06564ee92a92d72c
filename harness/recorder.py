# cython: boundscheck=False, wraparound=False
# (every index below is a place of a block: a block is a whole number of rows and flushed when it is full)
"""The canonical trace of a run: every frame on every bus and the body's state, hashed as they happen.

Three streams of fixed-width rows. Frames (hashed): three 64-bit integers a row. Samples of the plant
(hashed): doubles, time first. Words of the main brain's data table (not hashed, they follow from the
others): 64-bit integers, time first. A full block is hashed and, when a sink is set, handed over as bytes.
"""

import array
import hashlib

import cython

FRAME_COLUMNS = 3


class RowStream:
    """Rows of 64-bit values collected into blocks. `hashed`: feed the blocks to SHA-256 as well."""

    def __init__(self, code, columns, hashed, block_rows=512) -> None:
        self.columns = columns
        self.block_rows = block_rows
        self.capacity = columns * block_rows
        self.integers = array.array("q", [0]) * (self.capacity if code == "q" else 0)
        self.reals = array.array("d", [0.0]) * (self.capacity if code == "d" else 0)
        self.used = 0
        self.rows = 0
        self.last_time_ns = 0
        self.is_real = code == "d"
        self.digest = hashlib.sha256() if hashed else None
        self.sink = None

    def finish_row(self, time_ns: cython.longlong) -> cython.longlong:
        """Close the row that was just written at `used - columns`; returns how many there are."""
        self.rows += 1
        self.last_time_ns = time_ns
        if self.used == self.capacity:
            self.flush()
        return self.rows

    def flush(self) -> None:
        """Hash and hand over what the block holds."""
        if self.used == 0:
            return
        block: object = memoryview(self.reals) if self.is_real else memoryview(self.integers)
        block = block[: self.used]
        if self.digest is not None:
            self.digest.update(block)
        if self.sink is not None:
            self.sink(self.last_time_ns, block.tobytes())
        self.used = 0


class Recorder:
    """The three streams of one run. `sample_columns`, `word_columns`: without the time column."""

    def __init__(self, sample_columns, word_columns) -> None:
        self.frames = RowStream("q", FRAME_COLUMNS, True)
        self.samples = RowStream("d", sample_columns + 1, True)
        self.words = RowStream("q", word_columns + 1, False)

    def add_frames(self, bus: cython.longlong, log: cython.longlong[::1], count: cython.longlong) -> cython.longlong:
        """The first `count` frames that bus 0..3 logged, as `can_bus.bus.Bus` logs them: LOG_FIELDS numbers each, at
        the instant their receivers have them. Returns the number of rows."""
        stream: RowStream = self.frames
        at: cython.longlong = stream.used
        base: cython.longlong = 0
        for _frame in range(count):
            stream.integers[at] = log[base]
            stream.integers[at + 1] = (log[base + 3] << 12) | (log[base + 2] << 4) | bus
            stream.integers[at + 2] = (log[base + 4] << 29) | log[base + 1]
            at += 3
            stream.used = at
            stream.last_time_ns = log[base]
            if at == stream.capacity:
                stream.flush()
                at = 0
            base += 6  # LOG_FIELDS
        stream.rows += count
        return stream.rows

    def trace_digest(self):
        """SHA-256 (hex) over the frames and the samples so far; what is pending is flushed first."""
        self.frames.flush()
        self.samples.flush()
        total = hashlib.sha256(b"ranger-sim trace 1\n")
        total.update(self.frames.digest.digest())
        total.update(self.samples.digest.digest())
        return total.hexdigest()
