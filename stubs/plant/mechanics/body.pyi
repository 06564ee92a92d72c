# Generated from plant/mechanics/body.py and plant/mechanics/body.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.plant.mechanics.contact_equations import ContactEquations
from ranger_sim.plant.mechanics.leg import Leg
from ranger_sim.plant.mechanics.observed import Observed
from ranger_sim.plant.mechanics.parts import Ankle
from ranger_sim.plant.mechanics.parts import HipJoint
from ranger_sim.plant.mechanics.parts import Sole
from ranger_sim.plant.mechanics.term_torques import TermTorques
from typing import Any
from typing import final

HELD: int
SINGLE: int
DOUBLE: int
FLIGHT: int
FALLEN: int
MODE_NAMES: tuple[str, ...]

@final
class Body:
    outer: Leg
    inner: Leg
    stance: Leg
    swing: Leg
    mode: int
    step_start_ns: int
    changes: int
    hip_x: float
    hip_y: float
    hip_vx: float
    hip_vy: float
    hip: HipJoint
    ankle: Ankle
    brush: bool
    standing: bool
    lock_hip: bool
    terms: TermTorques
    M: float
    gx: float
    gy: float
    inverse_smoothing: float
    elapsed: float
    time_s: float
    strike_ahead: float
    seen: Observed
    last_strike: Leg
    saved: MutableSequence[float]
    closing_rate: float
    hip_ay: float
    sole: Sole
    event: int
    event_leg: Leg
    coulomb: bool
    compliant: bool
    floating: bool
    sliding: bool
    watched: bool
    unilateral: bool
    lift_leading: bool
    equations: ContactEquations
    parameters: Any
    floor: Any
    record: Any
    cause: str
    def __init__(self, parameters: Any = None, floor: Any = None) -> None: ...
    def set_slope(self, slope_rad: float) -> None: ...
    def stand_on(self, leg: Leg) -> None: ...
    def other(self, leg: Leg) -> Leg: ...
    def leg(self, side: int) -> Leg: ...
    def ahead(self) -> float: ...
    def anchor_foot(self, leg: Leg) -> None: ...
    def contact_x(self, leg: Leg) -> float: ...
    def update_pose(self) -> None: ...
    def update_hip_rates(self) -> None: ...
    def slip_m_per_s(self, leg: Leg) -> float: ...
    def hip_angle(self) -> float: ...
    def hip_rate(self) -> float: ...
    def stands(self, leg: Leg) -> bool: ...
    def snapshot(self) -> dict[Any, Any]: ...
    def lift(self) -> None: ...
    def energy_J(self) -> float: ...
    def event_time_ns(self) -> int: ...
