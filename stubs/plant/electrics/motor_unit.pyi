# Generated from plant/electrics/motor_unit.py and plant/electrics/motor_unit.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.plant.electrics.drive import Drive
from typing import Any
from typing import final

@final
class MotorUnit:
    drive: Drive
    mounting: float
    gear: float
    K: float
    angle_factor: float
    winding_ohm: float
    series_ohm: float
    contact_drop_V: float
    dead_time_fraction: float
    bridge_current_A: float
    known_s: float
    known_ohm: float
    per_s: float
    per_ohm: float
    decay: float
    decay_s: float
    decay_squared_s: float
    gate_W_per_V: float
    ripple_per_ohm2: float
    mu: float
    C0: float
    heat_s: float
    size_As: float
    square_A2s: float
    mechanical_J: float
    drawn_J: float
    returned_J: float
    ripple_J: float
    gate_J: float
    current_A: float
    battery_current_A: float
    drive_Nm: float
    coulomb_Nm: float
    viscous_Nms: float
    tau_s: float
    diode_drop_V: float
    diode_J: float
    total_As: float
    from_battery_As: float
    heat_matters: bool
    inductance_H: float
    C1: float
    inverse_smoothing: float
    resistance_per_K: float
    torque_constant_per_K: float
    G_wh: float
    G_ha: float
    inverse_C_w: float
    inverse_C_h: float
    air_C: float
    rotor_temperature_C: float
    housing_temperature_C: float
    heat_W: float
    drawn_before_J: float
    warmed_As: float
    warmed_A2s: float
    warmed_J: float
    warmed_ripple_J: float
    ripples: MutableSequence[float]
    name: str
    parameters: Any
    def __init__(self, name: str, parameters: Any = None, mounting: float = 1) -> None: ...
    def magnetic_J(self) -> float: ...
    def battery_J(self) -> float: ...
    def add_ripple(self, fraction: Any, periods_per_turn: Any, phase_rad: Any) -> None: ...
    def turn(self, angle_rad: float, rate_rad_s: float, seconds: float) -> None: ...
    def torque_Nm(self, current_A: float, rate_rad_s: float) -> float: ...
    def load(self, current_A: float) -> None: ...
    def step_electrical(self, t0: int, t1: int, rate_rad_s: float, battery_V: float) -> None: ...
    @property
    def mean_current_A(self) -> float: ...
    @property
    def contact_J(self) -> float: ...
    @property
    def series_J(self) -> float: ...
    @property
    def winding_J(self) -> float: ...
    def _warm(self, h: float) -> None: ...
