# Generated from boards/main_brain/hip_machine.py and boards/main_brain/hip_machine.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.main_brain.command import MotorCommand
from ranger_sim.boards.main_brain.state_machine import StateMachine
from ranger_sim.datatable.store import DataStore
from typing import Any

READS: tuple[str, ...]
WRITES: tuple[str, ...]
NOT_STOP: tuple[str, ...]

class HipMachine:
    store: DataStore
    MCH_ANGLE: int
    E_MCH_ANG_RATE: int
    E_LO_ANGLE: int
    E_LI_ANGLE: int
    E_SWING_LEG: int
    E_T_AFTER_HS: int
    E_AM_L_ABSRATE: int
    E_AM_H_ANG: int
    E_AM_H_RATE: int
    E_AM_TIMER: int
    MCFO_RIGHT_ANKLE_RATE: int
    MCFI_ANKLE_RATE: int
    FSM_LEG: int
    FSM_RESET: int
    C_H_OUTER_STIFFNESS: int
    C_H_PM_H_RATE: int
    P_H_PM_H_TRATE: int
    P_H_PM_TIME: int
    P_H_PM_F_RATE: int
    C_HI_SH_H_ANG: int
    C_HI_SH_H_RATE: int
    P_HI_SH_H_TANG: int
    C_H_EH_H_ANG: int
    C_H_EH_H_RATE: int
    P_H_EH_H_TANG: int
    P_H_EHOLD_ANG: int
    P_H_EHOLD_ANG2: int
    P_H_EH_L_TRATE: int
    D_H_ON: int
    DP_F_PP_L_ABSRATE: int
    DP_H_AM_H_ANG: int
    DP_H_AM_L_ABSRATE: int
    DP_H_AM_H_RATE: int
    DP_H_AM_TIME1: int
    DP_H_AM_TIME2: int
    DC2_H_AM_H_ANG1: int
    DC2_H_AM_H_ANG2: int
    DC2_H_AM_H_RATE1: int
    DC2_H_AM_H_RATE2: int
    DC3_H_AM_H_ANG1: int
    DC3_H_AM_H_ANG2: int
    DC3_H_AM_L_ABSRATE1: int
    DC3_H_AM_L_ABSRATE2: int
    DC3_H_AM_H_RATE1: int
    DC3_H_AM_H_RATE2: int
    E_H_DI1: int
    E_H_DI2: int
    FSM_HIP: int
    motor: MotorCommand
    premid_time: int
    leg_lo_aftermid: int
    leg_li_aftermid: int
    first_correction: float
    second_correction: float
    machine: StateMachine
    def __init__(self, store: DataStore) -> None: ...
    def publish_state(self, number: Any) -> None: ...
    def hold_start(self) -> None: ...
    def hold_inner_ahead(self) -> None: ...
    def hold_outer_ahead(self) -> None: ...
    def enter_premid(self) -> None: ...
    def enter_aftermid(self) -> None: ...
    def correction(self) -> float: ...
    def base_current(self, direction: float) -> float: ...
    def swing_inner(self) -> None: ...
    def swing_inner_corrected(self) -> None: ...
    def swing_outer(self) -> None: ...
    def swing_outer_corrected(self) -> None: ...
    def reset_wanted(self) -> bool: ...
    def inner_struck(self) -> bool: ...
    def outer_struck(self) -> bool: ...
    def inner_foot_flips_up(self) -> bool: ...
    def outer_foot_flips_up(self) -> bool: ...
    def outer_stance_past_mid(self) -> bool: ...
    def inner_stance_past_mid(self) -> bool: ...
    def hangs(self, direction: float) -> bool: ...
    def inner_leg_hangs(self) -> bool: ...
    def outer_leg_hangs(self) -> bool: ...
