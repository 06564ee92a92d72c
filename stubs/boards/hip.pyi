# Generated from boards/hip.py and boards/hip.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.joint_safety import HipSafety
from ranger_sim.boards.modules.quadrature_decoder import QuadratureDecoder
from ranger_sim.boards.motor_board import MotorBoard
from ranger_sim.firmware_sim.scheduler import Schedule
from typing import Any

CAN_INTERRUPTS: Any
SEQUENCE: tuple[tuple[Any, ...], ...]
READINGS: Any
LIMITS: Any
JOINT_ENCODER: tuple[float, ...]
MOTOR_ENCODER: tuple[float, ...]

class HipBoard(MotorBoard):
    joint: QuadratureDecoder
    safety: HipSafety
    def __init__(self, crystal: Any = None, quirks: Any = None, phase_ns: Any = 0) -> None: ...
    def schedule(self) -> Schedule: ...
    def set_start_values(self) -> None: ...
    def controlled_position(self) -> int: ...
    def motor_encoder_rezero(self) -> None: ...
