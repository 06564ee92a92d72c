# Generated from plant/mechanics/leg.py and plant/mechanics/leg.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import Any
from typing import final

OUTER: int
INNER: int
LEAST_FOOT_INERTIA: float
RIGID: tuple[str, ...]
LEG_NAMES: tuple[str, ...]

@final
class Leg:
    foot_angle: float
    angle: float
    motor_angle: float
    foot_rate: float
    rate: float
    motor_rate: float
    known_foot: float
    sin_foot: float
    cos_foot: float
    known_angle: float
    sin_leg: float
    cos_leg: float
    drive: float
    coulomb: float
    viscous: float
    Fx: float
    Fy: float
    foot_acc: float
    acc: float
    motor_acc: float
    anchor: float
    height: float
    gap: float
    hip_sign: float
    el: float
    r: float
    d: float
    heel: float
    toe: float
    Jf: float
    inverse_Jf: float
    C: float
    mc: float
    mw: float
    mt: float
    m22: float
    i33: float
    J: float
    extra_ankle: float
    extra_motor: float
    impulse_x: float
    impulse_y: float
    side: int
    slide: int
    armed: bool
    saved: MutableSequence[float]
    def __init__(self, side: int, parameters: Any) -> None: ...
    def excess(self, foot: float) -> float: ...
    def chain_x(self, foot: float, leg: float) -> float: ...
    def chain_y(self, foot: float, leg: float) -> float: ...
    def behind(self) -> float: ...
    def stretch(self) -> float: ...
    def limp(self) -> None: ...
    def lie(self) -> None: ...
