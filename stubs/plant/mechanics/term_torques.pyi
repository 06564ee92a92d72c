# Generated from plant/mechanics/term_torques.py and plant/mechanics/term_torques.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.plant.mechanics.leg import Leg
from typing import Any
from typing import final

STRIBECK: int
COULOMB: int
VISCOUS: int
DIRECTION: int
DRAG: int
SPRING: int
COGGING: int
TURN: int
STIFFENING: int
BACKLASH: int
SLACK: int
CABLE_DAMPING: int
HIP_JOINT: int
HIP_MOTOR: int
ANKLE_JOINT: int
ANKLE_MOTOR: int
ANKLE_CABLE: int

@final
class TermTorques:
    count: int
    zero_rad: float
    hip_gear: float
    ankle_gear: float
    inverse_smoothing: float
    forms: MutableSequence[int]
    places: MutableSequence[int]
    sides: MutableSequence[int]
    parameters: MutableSequence[float]
    def __init__(self, zero_rad: float, hip_gear: float, ankle_gear: float, smoothing_rad_s: Any) -> None: ...
    def add(self, form: Any, place: Any, side: Any, parameters: Any) -> None: ...
    def torque(self, i: int, q: float, w: float, gear: float) -> float: ...
    def torque_on_hip(self, h: float, h_rate: float) -> float: ...
    def act_on_ankle(self, leg: Leg, angle: float, rate: float, motor: float, motor_rate: float) -> None: ...
