# cython: boundscheck=False, wraparound=False
# (every index below is a column of a stream)
"""Samples of body and data table for the trace, at the main brain's rate."""

import array
from typing import TYPE_CHECKING

import cython

from ranger_sim.foundation.row_stream import RowStream

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.board import Board
    from ranger_sim.plant.plant import Plant

PERIOD_NS = 2_000_000


@cython.final
@cython.cclass
class Sampler:
    """Fills the streams `samples` (the body) and, unless it is None, `words` (the memory that `board` shows)."""

    plant: "Plant"
    board: "Board"
    samples: RowStream
    words: RowStream
    next_ns: cython.longlong
    columns: cython.longlong
    row: cython.double[::1]

    def __init__(self, plant, board, samples, words, start_ns) -> None:
        self.plant = plant
        self.board = board
        self.samples = samples
        self.words = words
        self.next_ns = start_ns  # when the next sample is due
        self.columns = len(plant.sample_names)
        self.row = array.array("d", [0.0]) * self.columns

    @cython.ccall
    def take(self, now: cython.longlong) -> None:
        """Add one row to each stream, at `now` (ns)."""
        stream: RowStream = self.samples
        at: cython.longlong = stream.used
        i: cython.longlong
        memory: cython.longlong[::1]
        self.plant.fill_sample(self.row)
        stream.reals[at] = now * 1e-9
        for i in range(self.columns):
            stream.reals[at + 1 + i] = self.row[i]
        stream.finish_row(now)
        if self.words is not None:
            memory = self.board.memory
            stream = self.words
            at = stream.used
            stream.integers[at] = now
            for i in range(stream.columns - 1):
                stream.integers[at + 1 + i] = memory[i]
            stream.finish_row(now)
        self.next_ns += PERIOD_NS
