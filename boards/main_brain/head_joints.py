"""The joint trackers of the program "head-2015": hip, and the two ankles from one description.

Source: robot.md C2.2 (laws), C6.3 C (targets of 20 August 2015). A tracker wants the torque kp (ref - x) + kd (rate of
ref - rate of x), gains in N m; the board's law is I = I0 - K p - D p'. So I0 = (kp ref + kd ref') / c, K = kp / c,
D = kd / c, with c in N m/A.

Springs across a joint are made up for. At the hip K is less by the spring over c, so that motor and spring together
are the tracker: read off the log of 20 August 2015 itself, whose hip motor makes up for a spring in its pushes
(docs/walk-2015.md). At the ankles the spring comes off kp altogether, as in the commands logged on 19 August: K =
(10 - 0.134) / 0.612 and I0 = K target + D rate (robot.md C6.3 A).

Leans are the estimator's, positive forward (robot.md C1.1); the firmware's angles th are their opposites.
"""

import cython
from cython.cimports.libc.math import sin

from ranger_sim.boards.main_brain.command import MotorCommand, table_id, variables_of
from ranger_sim.boards.main_brain.head_walk import FLIGHT, INNER_PUSH, INNER_SWING, OUTER_PUSH, OUTER_SWING
from ranger_sim.boards.main_brain.state_machine import ANY, State, StateMachine
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.store import DataStore

HIP_NM_PER_A = 1.188  # 0.018 N m/A times 66 (robot.md C2.2)
ANKLE_NM_PER_A = 0.612  # 0.018 N m/A times 34


@cython.cclass
class HeadHip:
    """Scissors while a leg swings, holds an angle while a foot pushes, off in flight."""

    store: DataStore
    # variables of the data table
    E_LO_ANGLE: cython.longlong
    E_LI_ANGLE: cython.longlong
    E_LO_RATE: cython.longlong
    E_LI_RATE: cython.longlong
    FSM_LEG: cython.longlong
    FSM_RESET: cython.longlong
    CTRL_HIP_KP: cython.longlong
    CTRL_HIP_KD: cython.longlong
    CTRL_WALK_SCISSOR_GAIN: cython.longlong
    CTRL_WALK_SCISSOR_OFFSET: cython.longlong
    HD_H_HOLD: cython.longlong
    HD_H_SPRING: cython.longlong
    HD_H_GRAVITY: cython.longlong
    state_number: cython.longlong
    motor: MotorCommand
    machine: StateMachine

    def __init__(self, store) -> None:
        self.store = store
        self.E_LO_ANGLE = table.E_LO_ANGLE
        self.E_LI_ANGLE = table.E_LI_ANGLE
        self.E_LO_RATE = table.E_LO_RATE
        self.E_LI_RATE = table.E_LI_RATE
        self.FSM_LEG = table.FSM_LEG
        self.FSM_RESET = table.FSM_RESET
        self.CTRL_HIP_KP = table.CTRL_HIP_KP
        self.CTRL_HIP_KD = table.CTRL_HIP_KD
        self.CTRL_WALK_SCISSOR_GAIN = table.CTRL_WALK_SCISSOR_GAIN
        self.CTRL_WALK_SCISSOR_OFFSET = table.CTRL_WALK_SCISSOR_OFFSET
        self.HD_H_HOLD = table.HD_H_HOLD
        self.HD_H_SPRING = table.HD_H_SPRING
        self.HD_H_GRAVITY = table.HD_H_GRAVITY
        self.state_number = table_id("FSM_HIP")
        motor: object = MotorCommand(store, "MCH")  # untyped, so that its methods are plain ones
        self.motor = motor
        self.machine = StateMachine(
            "hip",
            states=(State(0, "reset"), State(1, "track", None, self.track)),
            transitions=((ANY, "reset", self.reset_wanted), ("reset", "track", self.walking)),
            on_change=self.publish_state,
        )

    @cython.ccall
    def publish_state(self, number) -> None:
        self.store.set_int(self.state_number, number)

    @cython.ccall
    def reset_wanted(self) -> cython.bint:
        return self.store.get_int(self.FSM_RESET) == 1

    @cython.ccall
    def walking(self) -> cython.bint:
        return self.store.get_int(self.FSM_RESET) != 1

    @cython.ccall
    def track(self) -> None:
        """The law of the walk machine's state. Setup: legs held side by side, chosen by us."""
        store: DataStore = self.store
        state: cython.longlong = store.get_int(self.FSM_LEG)
        hold: float = store.get_float(self.HD_H_HOLD)
        if state == INNER_SWING:
            self.scissor(1.0, store.get_float(self.E_LO_ANGLE), store.get_float(self.E_LO_RATE))
        elif state == OUTER_SWING:
            self.scissor(-1.0, store.get_float(self.E_LI_ANGLE), store.get_float(self.E_LI_RATE))
        elif state == OUTER_PUSH:
            self.follow(hold, 0.0, 1.0)
        elif state == INNER_PUSH:
            self.follow(-hold, 0.0, -1.0)
        elif state == FLIGHT:
            self.motor.off()
        else:
            self.follow(0.0, 0.0, 0.0)

    @cython.ccall
    def scissor(self, sign: cython.double, lean: cython.double, rate: cython.double) -> None:
        """The swing leg mirrors the standing one. `sign`: 1 while the outer legs stand; `lean`, `rate`: of those that
        stand. h_ref = sign (offset + (gain + 1) lean)."""
        store: DataStore = self.store
        gain: float = sign * (store.get_float(self.CTRL_WALK_SCISSOR_GAIN) + 1.0)
        self.follow(sign * store.get_float(self.CTRL_WALK_SCISSOR_OFFSET) + gain * lean, gain * rate, sign)

    @cython.ccall
    def follow(self, target: cython.double, rate: cython.double, sign: cython.double) -> None:
        """Track a hip angle. `sign`: 1 while the inner legs swing, -1 while the outer ones do, 0 for none."""
        store: DataStore = self.store
        kp: float = store.get_float(self.CTRL_HIP_KP)
        kd: float = store.get_float(self.CTRL_HIP_KD)
        swing_lean: float = store.get_float(self.E_LI_ANGLE) if sign > 0.0 else store.get_float(self.E_LO_ANGLE)
        weight_Nm: float = -sign * store.get_float(self.HD_H_GRAVITY) * sin(swing_lean)
        self.motor.send(
            (kp * target + kd * rate + weight_Nm) / HIP_NM_PER_A,
            (kp - store.get_float(self.HD_H_SPRING)) / HIP_NM_PER_A,
            kd / HIP_NM_PER_A,
        )


@cython.cclass
class HeadAnkle:
    """Foot angles against the floor: a = zero - target - lean. Stands, pushes, or is flipped up."""

    store: DataStore
    flips_in_flight: cython.bint
    # variables of the data table
    FSM_LEG: cython.longlong
    FSM_RESET: cython.longlong
    CTRL_ANK_PUSH_KP: cython.longlong
    CTRL_ANK_PUSH_KD: cython.longlong
    CTRL_ANK_STANCE_KP: cython.longlong
    CTRL_ANK_STANCE_KD: cython.longlong
    CTRL_ANK_SWING_KP: cython.longlong
    CTRL_ANK_SWING_KD: cython.longlong
    HD_F_SPRING: cython.longlong
    HD_F_ZERO: cython.longlong
    HD_F_HOLD: cython.longlong
    HD_F_PUSH: cython.longlong
    HD_F_FLIP: cython.longlong
    own_swing: cython.longlong
    own_push: cython.longlong
    own_lean: cython.longlong
    own_rate: cython.longlong
    state_number: cython.longlong
    motor: MotorCommand
    machine: StateMachine

    def __init__(self, store, inner) -> None:
        self.store = store
        self.FSM_LEG = table.FSM_LEG
        self.FSM_RESET = table.FSM_RESET
        self.CTRL_ANK_PUSH_KP = table.CTRL_ANK_PUSH_KP
        self.CTRL_ANK_PUSH_KD = table.CTRL_ANK_PUSH_KD
        self.CTRL_ANK_STANCE_KP = table.CTRL_ANK_STANCE_KP
        self.CTRL_ANK_STANCE_KD = table.CTRL_ANK_STANCE_KD
        self.CTRL_ANK_SWING_KP = table.CTRL_ANK_SWING_KP
        self.CTRL_ANK_SWING_KD = table.CTRL_ANK_SWING_KD
        self.HD_F_SPRING = table.HD_F_SPRING
        self.HD_F_ZERO = table.HD_F_ZERO
        self.HD_F_HOLD = table.HD_F_HOLD
        self.HD_F_PUSH = table.HD_F_PUSH
        self.HD_F_FLIP = table.HD_F_FLIP
        own = "FI" if inner else "FO"
        self.own_swing = INNER_SWING if inner else OUTER_SWING
        self.own_push = INNER_PUSH if inner else OUTER_PUSH
        self.flips_in_flight = inner
        self.own_lean = table_id("E_LI_ANGLE" if inner else "E_LO_ANGLE")
        self.own_rate = table_id("E_LI_RATE" if inner else "E_LO_RATE")
        self.state_number = table_id(f"FSM_{own}")
        motor: object = MotorCommand(store, "MCFI" if inner else "MCFO")  # untyped, so that its methods are plain ones
        self.motor = motor
        self.machine = StateMachine(
            "inner foot" if inner else "outer foot",
            states=(State(0, "reset"), State(1, "track", None, self.track)),
            transitions=((ANY, "reset", self.reset_wanted), ("reset", "track", self.walking)),
            on_change=self.publish_state,
        )

    @cython.ccall
    def publish_state(self, number) -> None:
        self.store.set_int(self.state_number, number)

    @cython.ccall
    def reset_wanted(self) -> cython.bint:
        return self.store.get_int(self.FSM_RESET) == 1

    @cython.ccall
    def walking(self) -> cython.bint:
        return self.store.get_int(self.FSM_RESET) != 1

    @cython.ccall
    def track(self) -> None:
        """The law of the walk machine's state. Setup: the foot stands, chosen by us."""
        store: DataStore = self.store
        state: cython.longlong = store.get_int(self.FSM_LEG)
        if state == self.own_push:
            self.follow(
                store.get_float(self.HD_F_PUSH),
                store.get_float(self.CTRL_ANK_PUSH_KP),
                store.get_float(self.CTRL_ANK_PUSH_KD),
            )
        elif state == self.own_swing or (state == FLIGHT and self.flips_in_flight):
            self.follow(
                store.get_float(self.HD_F_FLIP),
                store.get_float(self.CTRL_ANK_SWING_KP),
                store.get_float(self.CTRL_ANK_SWING_KD),
            )
        else:
            self.follow(
                store.get_float(self.HD_F_HOLD),
                store.get_float(self.CTRL_ANK_STANCE_KP),
                store.get_float(self.CTRL_ANK_STANCE_KD),
            )

    @cython.ccall
    def follow(self, foot_target: cython.double, kp: cython.double, kd: cython.double) -> None:
        """Track the foot's angle against the floor, positive with the toe up."""
        store: DataStore = self.store
        target: float = store.get_float(self.HD_F_ZERO) - foot_target - store.get_float(self.own_lean)
        stiffness: float = (kp - store.get_float(self.HD_F_SPRING)) / ANKLE_NM_PER_A
        dampness: float = kd / ANKLE_NM_PER_A
        self.motor.send(
            stiffness * target - dampness * store.get_float(self.own_rate),
            stiffness,
            dampness,
        )


READS = variables_of(HeadHip) + variables_of(HeadAnkle)
