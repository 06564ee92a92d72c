# Generated from boards/main_brain/reflex_feet.py and boards/main_brain/reflex_feet.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.main_brain.command import MotorCommand
from ranger_sim.boards.main_brain.state_machine import StateMachine
from ranger_sim.datatable.store import DataStore
from typing import Any

READS: tuple[str, ...]

class ReflexFootMachine:
    store: DataStore
    inner: bool
    hip_sign: float
    zero: float
    own_swing: int
    prepush_ms: int
    push_ms: int
    MCH_ANGLE: int
    E_SWING_LEG: int
    E_R_DW: int
    FSM_RESET: int
    C_F_SST_F_ANG: int
    C_F_SST_F_RATE: int
    P_F_SST_F_TANG: int
    R_F_ST_I0: int
    R_F_ST_KP: int
    R_F_ST_KV: int
    R_F_PP_PHI: int
    R_F_PP_I0: int
    R_F_PP_DW: int
    R_F_PP_KV: int
    R_F_PU_I0: int
    R_F_PU_DW: int
    R_F_PU_KV: int
    R_F_PU_ANG: int
    R_F_PU_TIME: int
    R_F_FU_I0: int
    R_F_FU_KP: int
    R_F_FU_KV: int
    R_F_FD_PHI: int
    R_F_FD_Q3: int
    R_F_FD_I0: int
    R_F_FD_KP: int
    R_F_FD_KV: int
    motor_position: int
    own_angle: int
    other_angle: int
    push_to_strike: int
    missed_pushes: int
    state_number: int
    motor: MotorCommand
    machine: StateMachine
    def __init__(self, store: DataStore, inner: bool) -> None: ...
    def publish_state(self, number: Any) -> None: ...
    def send(self, I0: float, Kp: float, Kv: float) -> None: ...
    def hold_standing(self) -> None: ...
    def stand(self) -> None: ...
    def enter_prepush(self) -> None: ...
    def prepare_push(self) -> None: ...
    def enter_push(self) -> None: ...
    def push(self) -> None: ...
    def flip_up(self) -> None: ...
    def flip_down(self) -> None: ...
    def reset_wanted(self) -> bool: ...
    def own_foot_struck(self) -> bool: ...
    def other_foot_struck(self) -> bool: ...
    def leg_leans_far_enough(self) -> bool: ...
    def push_is_done(self) -> bool: ...
    def leg_swung_far_enough(self) -> bool: ...
