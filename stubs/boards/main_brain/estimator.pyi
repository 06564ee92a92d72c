# Generated from boards/main_brain/estimator.py and boards/main_brain/estimator.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.main_brain.filters import ButterworthFilter
from ranger_sim.boards.main_brain.geometry import FloorGeometry
from ranger_sim.datatable.store import DataStore
from typing import Any

SWING_BEHIND: int
AVERAGING: int
ARMED: int
WALKING: int
CONTACT_SUM: float
READS: tuple[str, ...]
WRITES: tuple[str, ...]

class EnergyMeter:
    started: bool
    stamp: int
    power_W: float
    energy_J: float
    def __init__(self) -> None: ...
    def update(self, power_W: float, stamp_ms: int) -> bool: ...

class HeelSensor:
    baseline: float
    count: int
    def __init__(self) -> None: ...
    def restart(self, raw: float) -> None: ...
    def average(self, raw: float) -> None: ...
    def touches(self, raw: float, threshold: float, ticks: float, base_limit: float) -> bool: ...

class Estimator:
    store: DataStore
    report: Any
    code_time_violation: int
    code_stutter: int
    code_fall: int
    TIMESTAMP: int
    MCH_ANGLE: int
    MCH_ANG_RATE: int
    MCH_MOTOR_VELOCITY: int
    MCFO_RIGHT_ANKLE_ANGLE: int
    MCFI_MID_ANKLE_ANGLE: int
    MCFO_LEFT_HEEL_SENSE: int
    MCFO_RIGHT_HEEL_SENSE: int
    MCFI_LEFT_HEEL_SENSE: int
    MCFI_RIGHT_HEEL_SENSE: int
    UI_ANG_RATE_X: int
    UI_ROLL: int
    MCH_BATT_POWER: int
    MCFO_BATT_POWER: int
    MCFI_BATT_POWER: int
    MCSI_BATT_POWER: int
    CSR_MCU_POWER: int
    FSM_RESET: int
    P_E_GYRO_BIAS: int
    P_E_ROLL_BIAS: int
    P_E_RESET: int
    P_E_HS_THRESHOLD: int
    P_E_HS_BASE_LIMIT: int
    P_E_HS_TICKS: int
    P_E_HS_H_ANG: int
    P_E_HS_F_ANG: int
    P_E_MIN_STEP_TIME: int
    P_E_FALL_ANG: int
    E_MCH_ANG_RATE: int
    E_H_MOTOR_RATE: int
    E_LO_ANGLE: int
    E_LI_ANGLE: int
    E_LO_RATE: int
    E_LI_RATE: int
    E_FO_ABSANG: int
    E_FI_ABSANG: int
    E_SWING_LEG: int
    E_T_AFTER_HS: int
    E_HS_TIME: int
    E_STEP_COUNT: int
    E_DISTANCE: int
    E_ANKLE_HEIGHT: int
    E_SWING_HEIGHT: int
    E_LO_ERROR: int
    E_HEEL_BASE_LEFT: int
    E_HEEL_BASE_RIGHT: int
    E_HEEL_STAGE: int
    EST_CONTACT_OUTER: int
    EST_CONTACT_INNER: int
    EST_LAST_STEP_LENGTH: int
    EST_LAST_STEP_ANGLE: int
    EST_LAST_STEP_DURATION: int
    EST_TOTAL_BATT_POWER: int
    EST_ENERGY_MCH: int
    EST_ENERGY_MCFO: int
    EST_ENERGY_MCFI: int
    EST_ENERGY_MCSI: int
    EST_ENERGY_OVERHEAD: int
    per_tick_filter: bool
    use_filtered_sum: bool
    use_imu_roll: bool
    first_reset_is_full: bool
    hip_rate: ButterworthFilter
    hip_motor_rate: ButterworthFilter
    gyro_rate: ButterworthFilter
    roll: ButterworthFilter
    outer_left_sense: ButterworthFilter
    outer_right_sense: ButterworthFilter
    inner_left_sense: ButterworthFilter
    inner_right_sense: ButterworthFilter
    floor: FloorGeometry
    sweet_spot_m: float
    ankle_zero: float
    foot_offset: float
    left: HeelSensor
    right: HeelSensor
    stage: int
    swing_leg: int
    last_reset: int
    gyro_stamp: int
    strike_time: int
    steps: int
    violations: int
    outer_angle: float
    outer_raw_rate: float
    distance_m: float
    front_foot: float
    gyro_started: bool
    first_step: bool
    fallen: bool
    meters: list[Any]
    hip_energy: EnergyMeter
    outer_energy: EnergyMeter
    inner_energy: EnergyMeter
    steer_energy: EnergyMeter
    mcu_energy: EnergyMeter
    def __init__(self, store: DataStore, quirks: Any, report: Any) -> None: ...
    def restart(self) -> None: ...
    def zero_way(self) -> None: ...
    def zero_counters(self) -> None: ...
    def update(self) -> None: ...
    def update_rates(self) -> None: ...
    def update_outer_angle(self) -> None: ...
    def detect_strike(self, hip: float, outer_ankle: float, inner_ankle: float) -> None: ...
    def set_stage(self, stage: int) -> None: ...
    def update_contact_sums(self) -> None: ...
    def contact_sum(self, inner: bool) -> float: ...
    def strike(self, hip: float, outer_ankle: float, inner_ankle: float) -> None: ...
    def update_heights(self, hip: float, outer_ankle: float, inner_ankle: float) -> None: ...
    def update_energy(self) -> None: ...
    def judge_fall(self, hip: float) -> None: ...
