# Generated from boards/modules/motor_limits.py and boards/modules/motor_limits.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.error_module import ErrorModule
from typing import Any
from typing import final

SLOT_S_FIXED: int
ONE: int
RATED_SPEED_RAD_S: float
SOFT_SPEED: float
SOFT_THERMAL: float

@final
class MotorLimits:
    thermal: int
    excess: int
    thermal_rate: int
    thermal_limit: int
    thermal_soft: int
    thermal_multiplier: int
    excess_multiplier: int
    current_min: int
    current_max: int
    target_min: int
    target_max: int
    speed_soft: int
    too_hot: bool
    overloaded: bool
    derating: bool
    peak: bool
    errors: ErrorModule
    thermal_slope: int
    excess_limit: int
    excess_fade: int
    speed_max: int
    code_target: int
    code_warm: int
    code_hot: int
    code_cooled: int
    code_excess: int
    code_excess_over: int
    code_speed: int
    code_peak: int
    def __init__(self, errors: ErrorModule, codes: Any, target_min: Any, target_max: Any, current_min: Any, current_max: Any, thermal_current: Any, thermal_time: Any, excess_limit: Any, gear: Any, derating: bool = True, peak: bool = True, speed: Any = True) -> None: ...
    def monitor(self, current: int) -> bool: ...
    def limit_target(self, target: int, velocity: int) -> int: ...
    def limit_duty(self, duty: int, current: int) -> int: ...
