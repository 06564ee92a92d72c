# Generated from plant/mechanics/steering.py and plant/mechanics/steering.pxd (python -m ranger_sim.tools.stubs); do not edit.

from typing import final

@final
class Steering:
    twist: float
    rate: float
    yaw: float
    path_x: float
    path_y: float
    hip_x: float
    known_yaw: float
    sin_yaw: float
    cos_yaw: float
    rotor_inertia: float
    swing_inertia: float
    stance_inertia: float
    stiffness: float
    damping: float
    stop: float
    def __init__(self, rotor_inertia_kg_m2: float = ...) -> None: ...
    def begin(self, hip_x: float) -> None: ...
    def advance(self, h: float, drive: float, coulomb: float, viscous: float, inverse_smoothing: float, outer_stands: bool, inner_stands: bool, hip_x: float) -> None: ...
