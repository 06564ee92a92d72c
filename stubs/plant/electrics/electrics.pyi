# Generated from plant/electrics/electrics.py and plant/electrics/electrics.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.plant.electrics.battery import Battery
from ranger_sim.plant.electrics.battery import BatteryParameters
from ranger_sim.plant.electrics.motor_parameters import MotorParameters
from ranger_sim.plant.electrics.motor_unit import MotorUnit
from ranger_sim.plant.sensors.foot_sensor import FootSensors
from ranger_sim.plant.sensors.noise import NoiseSource
from typing import Any
from typing import final
import dataclasses

ADS7871_REFERENCE_V: float
INTERNAL_REFERENCE_V: float
BOARD_CONSTANTS: tuple[tuple[float, ...], ...]
ROUTER_CURRENT_A_PER_COUNT: float
ROUTER_CURRENT_OFFSET: float
ROUTER_VOLT_PER_COUNT: float
ROUTER_VOLT_OFFSET: float
STEERING_CENTRE_V: float
STEERING_V_PER_RAD: float
STEERING_STEP_V: float

@dataclasses.dataclass(frozen=True)
class ElectricsParameters:
    hip: MotorParameters = ...
    outer_ankle: MotorParameters = ...
    inner_ankle: MotorParameters = ...
    steering: MotorParameters = ...
    battery: BatteryParameters = ...
    electronics_off: tuple[str, ...] = ...
    pwm_offset_A: float = ...
    motor_current_noise_A: float = ...
    battery_current_noise_A: float = ...
    steering_current_noise_A: float = ...
    voltage_noise_V: float = ...
    foot_noise_counts: float = ...
    steering_noise_V: float = ...
    battery_current_lag_s: float = ...
    voltage_clip_V: float = ...
    foot_rise_time_constant_s: float = ...
    foot_share: float = ...
    foot_full_load_N: float = ...
    def __post_init__(self) -> None: ...

@final
class Electrics:
    hip: MotorUnit
    outer_ankle: MotorUnit
    inner_ankle: MotorUnit
    steering: MotorUnit
    battery: Battery
    hip_rate: float
    outer_rate: float
    inner_rate: float
    steering_rate: float
    electronics_W: float
    electronics_J: float
    motor_current_A: float
    outer_feet: FootSensors
    inner_feet: FootSensors
    motors: list[Any]
    noise: NoiseSource
    lag_h: float
    lag_factor: float
    pwm_offset_A: float
    voltage_clip_V: float
    steering_rad: float
    steering_shown_rad: float
    has_terms: bool
    has_ripple: bool
    battery_A: MutableSequence[float]
    values: MutableSequence[float]
    zero_V: MutableSequence[float]
    slope_V: MutableSequence[float]
    noise_V: MutableSequence[float]
    analog_end: MutableSequence[float]
    analog_start: MutableSequence[float]
    battery_current_lag_s: float
    scale: MutableSequence[float]
    offset: MutableSequence[float]
    lag_s: MutableSequence[float]
    state: MutableSequence[float]
    parameters: Any
    def __init__(self, parameters: Any = None, seed: Any = 0) -> None: ...
    def step_motors(self, t0: int, t1: int, hip_rate: float, outer_rate: float, inner_rate: float, steering_rate: float, jumped: bool = True) -> None: ...
    def turn_motors(self, t0: int, t1: int, hip_rad: float, outer_rad: float, inner_rad: float, hip_rate: float, outer_rate: float, inner_rate: float) -> None: ...
    def sense(self, t0: int, t1: int, outer_contact: bool, outer_load_N: float, inner_contact: bool, inner_load_N: float, steering_rad: float) -> None: ...
    def settle(self, outer_contact: bool, outer_load_N: float, inner_contact: bool, inner_load_N: float, steering_rad: float) -> None: ...
