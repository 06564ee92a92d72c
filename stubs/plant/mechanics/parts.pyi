# Generated from plant/mechanics/parts.py and plant/mechanics/parts.pxd (python -m ranger_sim.tools.stubs); do not edit.

from typing import Any
from typing import final

@final
class HipJoint:
    drive: float
    coulomb: float
    viscous: float
    k: float
    J: float
    exact: bool
    exact_k: float
    l0: float
    ab: float
    aabb: float
    def __init__(self, parameters: Any) -> None: ...
    def spring_torque(self, angle: float) -> float: ...
    def spring_energy(self, angle: float) -> float: ...

@final
class Ankle:
    k: float
    J: float
    inverse_J: float
    low: float
    high: float
    stop_k: float
    stop_c: float
    return_k: float
    rest: float
    def __init__(self, parameters: Any) -> None: ...
    def stop_torque(self, angle: float, rate: float) -> float: ...

@final
class Sole:
    k: float
    c: float
    per_m_s: float
    mu: float
    floor_k: float
    floor_a: float
    floor_per_m_s: float
    def __init__(self, parameters: Any) -> None: ...
