# Generated from boards/main_brain/leg_machine.py and boards/main_brain/leg_machine.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.main_brain.state_machine import StateMachine
from ranger_sim.datatable.store import DataStore
from typing import Any

READS: tuple[str, ...]
WRITES: tuple[str, ...]

class StanceLeg:
    owner: LegMachine
    store: DataStore
    other: StanceLeg
    angle_id: int
    preswing_ms: int
    hip_sign: float
    strike_angle: float
    ss0_angle: float
    ss0_rate: float
    mid_rate: float
    mid_hip: float
    mid_hip_rate: float
    mid_time: float
    def __init__(self, owner: LegMachine, angle_id: int, hip_sign: float) -> None: ...
    def angle_before_vertical(self) -> float: ...
    def hip_ahead(self) -> float: ...
    def enter_preswing(self) -> None: ...
    def count_preswing(self) -> None: ...
    def leave_preswing(self) -> None: ...
    def enter_premid(self) -> None: ...
    def enter_aftermid(self) -> None: ...

class LegMachine:
    store: DataStore
    E_LO_ANGLE: int
    E_LI_ANGLE: int
    E_SWING_LEG: int
    E_T_AFTER_HS: int
    MCH_ANGLE: int
    MCFO_RIGHT_ANKLE_RATE: int
    MCFI_ANKLE_RATE: int
    FSM_RESET: int
    P_H_PM_F_RATE: int
    P_L_START_ABSRATE: int
    P_L_START_H_RATE: int
    E_AM_L_ABSRATE: int
    E_AM_H_ANG: int
    E_AM_H_RATE: int
    E_AM_TIME: int
    E_AM_TIMER: int
    E_PS_TIME: int
    E_SS_L_ANG: int
    E_SS_L_ABSRATE: int
    FSM_LEG: int
    outer: StanceLeg
    inner: StanceLeg
    ss0_angle: float
    ss0_hip: float
    ss0_time: int
    aftermid_ms: int
    ss0_known: bool
    rate_of_previous_step: bool
    machine: StateMachine
    def __init__(self, store: DataStore, quirks: Any) -> None: ...
    def preset(self) -> None: ...
    def publish_state(self, number: Any) -> None: ...
    def count_aftermid(self) -> None: ...
    def leave_aftermid(self) -> None: ...
    def reset_wanted(self) -> bool: ...
    def inner_foot_flips_up(self) -> bool: ...
    def outer_foot_flips_up(self) -> bool: ...
    def outer_leg_past_vertical(self) -> bool: ...
    def inner_leg_past_vertical(self) -> bool: ...
    def inner_struck(self) -> bool: ...
    def outer_struck(self) -> bool: ...
