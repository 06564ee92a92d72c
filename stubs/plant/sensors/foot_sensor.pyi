# Generated from plant/sensors/foot_sensor.py and plant/sensors/foot_sensor.pxd (python -m ranger_sim.tools.stubs); do not edit.

from typing import Any
from typing import final

SWING_COUNTS: float
STANCE_COUNTS: float
VOLTS_PER_COUNT: float

@final
class FootSensors:
    closure: float
    last_h: float
    decay: float
    share: float
    per_N: float
    left_gain: float
    right_gain: float
    swing_counts: float
    span_counts: float
    left_V: float
    right_V: float
    rise_time_constant_s: float
    name: str
    def __init__(self, name: str, rise_time_constant_s: float = 0.012, share: float = 0.4, full_load_N: Any = 50.0, left_gain: float = 1.0, right_gain: float = 1.0, swing_counts: float = ..., stance_counts: Any = ...) -> None: ...
    def step(self, h: float, contact: bool, load_N: float) -> None: ...
    def settle(self, contact: bool, load_N: float) -> None: ...
