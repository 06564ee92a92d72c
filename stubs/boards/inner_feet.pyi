# Generated from boards/inner_feet.py and boards/inner_feet.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.ankle_board import AnkleBoard
from ranger_sim.firmware_sim.scheduler import Schedule
from typing import Any

READINGS: Any
MOTOR_ENCODER: tuple[float, ...]
JOINT_ENCODER: tuple[float, ...]
ABSOLUTE_ENCODER: Any
REZERO_SHARE: float
OPERATION_SIGN: int

class InnerFeetBoard(AnkleBoard):
    def __init__(self, crystal: Any = None, quirks: Any = None, phase_ns: Any = 0) -> None: ...
    def schedule(self) -> Schedule: ...
