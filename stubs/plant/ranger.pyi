# Generated from plant/ranger.py and plant/ranger.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.plant.electrics.electrics import Electrics
from ranger_sim.plant.electrics.motor_unit import MotorUnit
from ranger_sim.plant.mechanics.body import Body
from ranger_sim.plant.mechanics.steering import Steering
from ranger_sim.plant.plant import Plant
from ranger_sim.plant.sensors.absolute_encoder import AbsoluteEncoder
from ranger_sim.plant.sensors.imu import Imu
from ranger_sim.plant.sensors.incremental_encoder import IncrementalEncoder
from typing import Any
from typing import final

STEP_NS: int
SAMPLES: dict[str, str]
HIP_BOUNCE: float

@final
class RangerPlant(Plant):
    changes: int
    step_s: float
    zero: float
    body: Body
    electrics: Electrics
    steering: Steering
    hip: MotorUnit
    outer_ankle: MotorUnit
    inner_ankle: MotorUnit
    steering_motor: MotorUnit
    hip_joint: IncrementalEncoder
    hip_motor: IncrementalEncoder
    outer_motor: IncrementalEncoder
    outer_joint: IncrementalEncoder
    inner_motor: IncrementalEncoder
    inner_joint: IncrementalEncoder
    hip_word: AbsoluteEncoder
    outer_word: AbsoluteEncoder
    inner_word: AbsoluteEncoder
    imu: Imu
    jumped: bool
    strike_time_ns: int
    lift_off_time_ns: int
    step_length_m: float
    motors: list[Any]
    parameters: Any
    floor: Any
    record: Any
    model_file: Any
    def __init__(self, seed: Any = 0, slope_rad: Any = 0.0, floor_roughness_m: Any = 0.0, model_file: Any = None, start_ns: int = 0, parameters: Any = None, electrics: Any = None, floor: Any = None) -> None: ...
    def hold(self, stance: Any = 'outer', lean_rad: float = 0.0, hip_angle_rad: float = 0.3, outer_ankle_rad: float = 1.68, inner_ankle_rad: float = 1.68, lifted: bool = False) -> None: ...
    def release(self, rate_rad_s: float, hip_rate_rad_s: float = 0.0) -> None: ...
    def begin(self) -> None: ...
    def _settle(self) -> None: ...
    def step(self) -> None: ...
    def _note(self) -> None: ...
    def encoder_rad(self, number: Any) -> float: ...
    def word_rad(self, number: Any) -> float: ...
    def analog_line(self, number: Any) -> tuple[float, float, float]: ...
    def analog_value(self, number: Any) -> float: ...
    def fill_sample(self, row: MutableSequence[float] | memoryview[float]) -> Any: ...
    @property
    def electronics_power_W(self) -> Any: ...
    @property
    def battery_V(self) -> Any: ...
    def geometry(self) -> dict[str, Any]: ...
    def recent_steps(self) -> tuple[Any, ...]: ...
    def recent_footholds(self) -> Any: ...
