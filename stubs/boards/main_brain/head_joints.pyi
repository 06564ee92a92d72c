# Generated from boards/main_brain/head_joints.py and boards/main_brain/head_joints.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.main_brain.command import MotorCommand
from ranger_sim.boards.main_brain.state_machine import StateMachine
from ranger_sim.datatable.store import DataStore
from typing import Any

HIP_NM_PER_A: float
ANKLE_NM_PER_A: float
HIP_READS: tuple[str, ...]
ANKLE_READS: tuple[str, ...]
READS: Any

class HeadHip:
    store: DataStore
    E_LO_ANGLE: int
    E_LI_ANGLE: int
    E_LO_RATE: int
    E_LI_RATE: int
    FSM_LEG: int
    FSM_RESET: int
    CTRL_HIP_KP: int
    CTRL_HIP_KD: int
    CTRL_WALK_SCISSOR_GAIN: int
    CTRL_WALK_SCISSOR_OFFSET: int
    HD_H_HOLD: int
    HD_H_SPRING: int
    HD_H_GRAVITY: int
    state_number: int
    motor: MotorCommand
    machine: StateMachine
    def __init__(self, store: DataStore) -> None: ...
    def publish_state(self, number: Any) -> None: ...
    def reset_wanted(self) -> bool: ...
    def walking(self) -> bool: ...
    def track(self) -> None: ...
    def scissor(self, sign: float, lean: float, rate: float) -> None: ...
    def follow(self, target: float, rate: float, sign: float) -> None: ...

class HeadAnkle:
    store: DataStore
    flips_in_flight: bool
    FSM_LEG: int
    FSM_RESET: int
    CTRL_ANK_PUSH_KP: int
    CTRL_ANK_PUSH_KD: int
    CTRL_ANK_STANCE_KP: int
    CTRL_ANK_STANCE_KD: int
    CTRL_ANK_SWING_KP: int
    CTRL_ANK_SWING_KD: int
    HD_F_SPRING: int
    HD_F_ZERO: int
    HD_F_HOLD: int
    HD_F_PUSH: int
    HD_F_FLIP: int
    own_swing: int
    own_push: int
    own_lean: int
    own_rate: int
    state_number: int
    motor: MotorCommand
    machine: StateMachine
    def __init__(self, store: DataStore, inner: bool) -> None: ...
    def publish_state(self, number: Any) -> None: ...
    def reset_wanted(self) -> bool: ...
    def walking(self) -> bool: ...
    def track(self) -> None: ...
    def follow(self, foot_target: float, kp: float, kd: float) -> None: ...
