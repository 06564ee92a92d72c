# Generated from harness/records/strike_watch.py and harness/records/strike_watch.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.firmware_sim.board import Board
from ranger_sim.harness.step_watch import StepEnd
from ranger_sim.plant.ranger import RangerPlant
from typing import Any
from typing import final

@final
class StrikeWatch(StepEnd):
    plant: RangerPlant
    board: Board
    swing_leg: int
    seen_ns: int
    steps_noticed: int
    count: int
    unmatched: int
    missed: int
    sum_ms: float
    squares_ms2: float
    def __init__(self, plant: RangerPlant, board: Board) -> None: ...
    def look(self) -> Any: ...
    def statistics(self) -> dict[Any, Any]: ...
