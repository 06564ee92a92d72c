"""The canonical trace of a run: every frame on every bus and the body's state, hashed as they happen.

Streams of fixed-width rows. Frames (hashed), one stream per bus. Samples of the plant (hashed): doubles, time first.
Words of the main brain's data table (not hashed, they follow from the others): 64-bit integers, time first.
"""

import hashlib

import cython

from ranger_sim.foundation.row_stream import DIGEST_BYTES, FrameStream, RowStream


@cython.final
@cython.cclass
class Recorder:
    """The streams of one run. `buses`: how many; `sample_columns`, `word_columns`: without the time column."""

    frames: list
    samples: RowStream
    words: RowStream

    def __init__(self, buses, sample_columns, word_columns) -> None:
        self.frames = [FrameStream(bus) for bus in range(buses)]
        self.samples = RowStream("d", sample_columns + 1, True)
        self.words = RowStream("q", word_columns + 1, False)

    def streams(self) -> dict:
        """Every stream by its name; those of bus 1's frames are can1."""
        frames = {f"can{number}": stream for number, stream in enumerate(self.frames, start=1)}
        return {**frames, "samples": self.samples, "words": self.words}

    def trace_digest(self):
        """BLAKE2b-256 (hex) over the frames of every bus and the samples so far; pending rows are flushed first."""
        total = hashlib.blake2b(b"ranger-sim trace 3\n", digest_size=DIGEST_BYTES)
        for stream in (*self.frames, self.samples):
            stream.flush()
            total.update(stream.digest.digest())
        return total.hexdigest()
