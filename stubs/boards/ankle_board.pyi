# Generated from boards/ankle_board.py and boards/ankle_board.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.foot_contact import FootContact
from ranger_sim.boards.modules.joint_safety import AnkleSafety
from ranger_sim.boards.modules.limit_switch import LimitSwitch
from ranger_sim.boards.modules.quadrature_decoder import QuadratureDecoder
from ranger_sim.boards.motor_board import MotorBoard
from typing import Any

LEFT_FOOT: int
RIGHT_FOOT: int
SEQUENCE: tuple[tuple[Any, ...], ...]
LIMITS: Any
GEAR: float
FOOT_ON_LEVEL: int
FOOT_OFF_LEVEL: int
REZERO_ANGLE_RAD: float
REZERO_RATE_RAD_S: float
SET_CYCLES: int

class AnkleBoard(MotorBoard):
    joint: QuadratureDecoder
    safety: AnkleSafety
    left_foot: FootContact
    right_foot: FootContact
    left_switch: LimitSwitch
    right_switch: LimitSwitch
    rezero_share: float
    rezero_angle: float
    rezero_rate: float
    def __init__(self, table: Any, crystal: Any, quirks: Any, phase_ns: Any, readings: Any, sign: Any, motor_encoder: Any, joint_encoder: Any, absolute_encoder: Any, rezero_share: float, right_off_level: Any) -> None: ...
    def set_start_values(self) -> None: ...
    def update_switches(self) -> None: ...
    def motor_encoder_rezero(self) -> None: ...
    def right_heel_sense(self) -> int: ...
    def left_heel_sense(self) -> int: ...
