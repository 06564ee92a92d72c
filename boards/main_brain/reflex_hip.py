"""The hip machine of the program "reflex": swings the leg, then holds it where the foot is to land.

Source: robot.md P4. In each state the current is I0 + Kp q3 + Kv q3', with q3 = phi_stance - phi_swing, negative while
the swing leg is ahead (signs in reflex_leg.py). The hip angle h of the robot is -q3 while the outer legs stand and
+q3 while the inner ones do, and so is the motor's current (robot.md C1.1); the board's law is I = I0 - K h - D h'.
So K = -Kp and D = -Kv for either leg, and I0 changes its sign.
"""

import cython

from ranger_sim.boards.main_brain.command import MotorCommand, variables_of
from ranger_sim.boards.main_brain.state_machine import ANY, State, StateMachine
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.store import DataStore


@cython.cclass
class ReflexHipMachine:
    """States 0 HI_starthold ... 4 HO_place; HI: the inner legs swing. `machine` is stepped after the leg machine."""

    store: DataStore
    # variables of the data table
    E_LO_ANGLE: cython.longlong
    E_LI_ANGLE: cython.longlong
    E_SWING_LEG: cython.longlong
    E_R_DW: cython.longlong
    FSM_RESET: cython.longlong
    C_HI_SH_H_ANG: cython.longlong
    C_HI_SH_H_RATE: cython.longlong
    P_HI_SH_H_TANG: cython.longlong
    R_H_SW_I0: cython.longlong
    R_H_SW_DW: cython.longlong
    R_H_PL_PHI: cython.longlong
    R_H_PL_I0: cython.longlong
    R_H_PL_DW: cython.longlong
    R_H_PL_KP: cython.longlong
    R_H_PL_KV: cython.longlong
    FSM_HIP: cython.longlong
    motor: MotorCommand
    machine: StateMachine

    def __init__(self, store) -> None:
        self.store = store
        self.E_LO_ANGLE = table.E_LO_ANGLE
        self.E_LI_ANGLE = table.E_LI_ANGLE
        self.E_SWING_LEG = table.E_SWING_LEG
        self.E_R_DW = table.E_R_DW
        self.FSM_RESET = table.FSM_RESET
        self.C_HI_SH_H_ANG = table.C_HI_SH_H_ANG
        self.C_HI_SH_H_RATE = table.C_HI_SH_H_RATE
        self.P_HI_SH_H_TANG = table.P_HI_SH_H_TANG
        self.R_H_SW_I0 = table.R_H_SW_I0
        self.R_H_SW_DW = table.R_H_SW_DW
        self.R_H_PL_PHI = table.R_H_PL_PHI
        self.R_H_PL_I0 = table.R_H_PL_I0
        self.R_H_PL_DW = table.R_H_PL_DW
        self.R_H_PL_KP = table.R_H_PL_KP
        self.R_H_PL_KV = table.R_H_PL_KV
        self.FSM_HIP = table.FSM_HIP
        motor: object = MotorCommand(store, "MCH")  # untyped, so that its methods are plain ones
        self.motor = motor
        self.machine = StateMachine(
            "hip",
            states=(
                #     no. name             entry  main
                State(0, "HI_starthold", None, self.hold_start),
                State(1, "HO_swing", None, self.swing_outer),
                State(2, "HO_place", None, self.place_outer),
                State(3, "HI_swing", None, self.swing_inner),
                State(4, "HI_place", None, self.place_inner),
            ),
            transitions=(
                # from                            to             when
                (ANY, "HI_starthold", self.reset_wanted),
                (("HI_starthold", "HI_swing", "HI_place"), "HO_swing", self.inner_struck),
                (("HO_swing", "HO_place"), "HI_swing", self.outer_struck),
                ("HO_swing", "HO_place", self.inner_stance_far_enough),
                ("HI_swing", "HI_place", self.outer_stance_far_enough),
            ),
            on_change=self.publish_state,
        )

    @cython.ccall
    def publish_state(self, number) -> None:
        self.store.set_int(self.FSM_HIP, number)

    # -- actions ---------------------------------------------------------------------------------

    @cython.ccall
    def hold_start(self) -> None:
        """Hold the inner legs ahead until the first heel strike, as the record walk's program does."""
        stiffness: float = self.store.get_float(self.C_HI_SH_H_ANG)
        self.motor.send(
            stiffness * self.store.get_float(self.P_HI_SH_H_TANG),
            stiffness,
            self.store.get_float(self.C_HI_SH_H_RATE),
        )

    @cython.ccall
    def swing(self, sign: cython.double) -> None:
        """`sign`: of the hip angle against q3, -1 while the outer legs stand."""
        store: DataStore = self.store
        self.motor.send(
            sign * (store.get_float(self.R_H_SW_I0) + store.get_float(self.R_H_SW_DW) * store.get_float(self.E_R_DW)),
            0.0,
            0.0,
        )

    @cython.ccall
    def place(self, sign: cython.double) -> None:
        store: DataStore = self.store
        self.motor.send(
            sign * (store.get_float(self.R_H_PL_I0) + store.get_float(self.R_H_PL_DW) * store.get_float(self.E_R_DW)),
            -store.get_float(self.R_H_PL_KP),
            -store.get_float(self.R_H_PL_KV),
        )

    @cython.ccall
    def swing_inner(self) -> None:
        self.swing(-1.0)

    @cython.ccall
    def swing_outer(self) -> None:
        self.swing(1.0)

    @cython.ccall
    def place_inner(self) -> None:
        self.place(-1.0)

    @cython.ccall
    def place_outer(self) -> None:
        self.place(1.0)

    # -- conditions ------------------------------------------------------------------------------

    @cython.ccall
    def reset_wanted(self) -> cython.bint:
        return self.store.get_int(self.FSM_RESET) == 1

    @cython.ccall
    def inner_struck(self) -> cython.bint:
        return self.store.get_int(self.E_SWING_LEG) == 0

    @cython.ccall
    def outer_struck(self) -> cython.bint:
        return self.store.get_int(self.E_SWING_LEG) == 1

    @cython.ccall
    def outer_stance_far_enough(self) -> cython.bint:
        return -self.store.get_float(self.E_LO_ANGLE) < self.store.get_float(self.R_H_PL_PHI)

    @cython.ccall
    def inner_stance_far_enough(self) -> cython.bint:
        return -self.store.get_float(self.E_LI_ANGLE) < self.store.get_float(self.R_H_PL_PHI)


READS = variables_of(ReflexHipMachine)
