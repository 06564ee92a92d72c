# Generated from harness/records/sampler.py and harness/records/sampler.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.board import Board
from ranger_sim.foundation.row_stream import RowStream
from ranger_sim.plant.plant import Plant
from typing import final

PERIOD_NS: int

@final
class Sampler:
    plant: Plant
    board: Board
    samples: RowStream
    words: RowStream | None
    next_ns: int
    columns: int
    row: MutableSequence[float]
    def __init__(self, plant: Plant, board: Board, samples: RowStream, words: RowStream | None, start_ns: int) -> None: ...
    def take(self, now: int) -> None: ...
