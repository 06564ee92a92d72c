# Generated from boards/main_brain/foot_machines.py and boards/main_brain/foot_machines.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.main_brain.command import MotorCommand
from ranger_sim.boards.main_brain.state_machine import StateMachine
from ranger_sim.datatable.store import DataStore
from typing import Any

COMMON: tuple[str, ...]
OF_ONE_PAIR: tuple[str, ...]

class FootMachine:
    store: DataStore
    inner: bool
    wait_for_strike: bool
    strike_logged: bool
    hip_sign: float
    hip_margin: float
    push_gain: float
    push_base: float
    push_angle: float
    push_start: float
    turned: float
    own_swing: int
    push_ms: int
    passive_ms: int
    MCH_ANGLE: int
    E_SWING_LEG: int
    E_ANKLE_HEIGHT: int
    E_AM_L_ABSRATE: int
    FSM_RESET: int
    C_F_ST_F_ANG: int
    C_F_ST_F_RATE: int
    P_F_ST_F_TANG: int
    C_F_PP_F_ANG: int
    C_F_PP_F_RATE: int
    P_F_PP_F_TANG: int
    P_F_PP_FRAC_ANG: int
    P_F_PP_F_ABSANG: int
    C_F_FU_F_ANG: int
    C_F_FU_F_RATE: int
    P_F_FU_F_TANG: int
    P_F_FU_H_ANG: int
    P_F_FU_F_CABL_STRETCH: int
    C_F_FD_F_ANG: int
    C_F_FD_F_RATE: int
    P_F_FD_F_TANG: int
    C_F_SST_F_ANG: int
    C_F_SST_F_RATE: int
    P_F_SST_F_TANG: int
    P_F_AP_TIME: int
    D_F_ON: int
    DP_F_PP_L_ABSRATE: int
    DP_H_AM_L_ABSRATE: int
    DC_F_PP_L_ABSRATE: int
    DC_F_PP_L_ABSRATE2: int
    motor_position: int
    ankle_angle: int
    own_absolute: int
    other_absolute: int
    push_height: int
    push_to_strike: int
    missed_pushes: int
    state_number: int
    motor: MotorCommand
    machine: StateMachine
    def __init__(self, store: DataStore, quirks: Any, inner: bool) -> None: ...
    def publish_state(self, number: Any) -> None: ...
    def track_absolute(self, target: float, stiffness: float, dampness: float) -> None: ...
    def track_motor(self, target: float, stiffness: float, dampness: float) -> None: ...
    def hold_flipped_down(self) -> None: ...
    def hold_standing(self) -> None: ...
    def track_stance(self) -> None: ...
    def enter_prepush(self) -> None: ...
    def push(self) -> None: ...
    def correction_applies(self) -> bool: ...
    def push_target(self) -> float: ...
    def enter_afterpush(self) -> None: ...
    def go_limp(self) -> None: ...
    def flip_up(self) -> None: ...
    def flip_down(self) -> None: ...
    def reset_wanted(self) -> bool: ...
    def own_foot_struck(self) -> bool: ...
    def other_foot_struck(self) -> bool: ...
    def push_is_due(self) -> bool: ...
    def push_is_done(self) -> bool: ...
    def cable_is_slack_enough(self) -> bool: ...
    def own_leg_is_ahead(self) -> bool: ...
