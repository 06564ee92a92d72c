"""The machines of the two ankle motors in the program "reflex", from one description.

Source: robot.md P4. In each state the current is I0 + Kp q_m + Kv q_m', with q_m the motor's angle from the ankle's
zero, 1.68 rad (robot.md C1.1). The board's law is I = I0 - K p - D p' with p = q_m + 1.68 (robot.md C1.2), so K = -Kp,
D = -Kv, and I0 less Kp times 1.68 is sent. phi and q3 as in reflex_leg.py and reflex_hip.py.

A state's dw shifts I0 per rad/s. The start is the record walk's: the outer feet stand stiff and skip their first push,
the inner ones come down as in a flip-down.
"""

import cython

from ranger_sim.boards.main_brain.command import MotorCommand, table_id, variables_of
from ranger_sim.boards.main_brain.state_machine import ANY, State, StateMachine
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.store import DataStore


@cython.cclass
class ReflexFootMachine:
    """inner: True for the inner ankles. `machine` is stepped after the hip machine, inner feet first.

    States 0 start ... 5 flipdown.
    More than 40 fields, because most are the ids of its variables in the data table, which compiled code then finds
    without a dictionary.
    """

    store: DataStore
    inner: cython.bint
    hip_sign: cython.double
    zero: cython.double
    own_swing: cython.longlong
    prepush_ms: cython.longlong
    push_ms: cython.longlong
    # variables of the data table
    MCH_ANGLE: cython.longlong
    E_SWING_LEG: cython.longlong
    E_R_DW: cython.longlong
    FSM_RESET: cython.longlong
    C_F_SST_F_ANG: cython.longlong
    C_F_SST_F_RATE: cython.longlong
    P_F_SST_F_TANG: cython.longlong
    R_F_ST_I0: cython.longlong
    R_F_ST_KP: cython.longlong
    R_F_ST_KV: cython.longlong
    R_F_PP_PHI: cython.longlong
    R_F_PP_I0: cython.longlong
    R_F_PP_DW: cython.longlong
    R_F_PP_KV: cython.longlong
    R_F_PU_I0: cython.longlong
    R_F_PU_DW: cython.longlong
    R_F_PU_KV: cython.longlong
    R_F_PU_ANG: cython.longlong
    R_F_PU_TIME: cython.longlong
    R_F_FU_I0: cython.longlong
    R_F_FU_KP: cython.longlong
    R_F_FU_KV: cython.longlong
    R_F_FD_PHI: cython.longlong
    R_F_FD_Q3: cython.longlong
    R_F_FD_I0: cython.longlong
    R_F_FD_KP: cython.longlong
    R_F_FD_KV: cython.longlong
    motor_position: cython.longlong
    own_angle: cython.longlong
    other_angle: cython.longlong
    push_to_strike: cython.longlong
    missed_pushes: cython.longlong
    state_number: cython.longlong
    motor: MotorCommand
    machine: StateMachine

    def __init__(self, store, inner: cython.bint) -> None:
        own, board = ("FI", "MCFI") if inner else ("FO", "MCFO")
        self.store = store
        self.inner = inner
        self.hip_sign = 1.0 if inner else -1.0  # of the hip angle, positive while the own legs are ahead
        self.own_swing = 1 if inner else 0  # value of E_SWING_LEG while the own legs swing
        self.zero = 1.68  # rad (robot.md C1.1)
        self.MCH_ANGLE = table.MCH_ANGLE
        self.E_SWING_LEG = table.E_SWING_LEG
        self.E_R_DW = table.E_R_DW
        self.FSM_RESET = table.FSM_RESET
        self.C_F_SST_F_ANG = table.C_F_SST_F_ANG
        self.C_F_SST_F_RATE = table.C_F_SST_F_RATE
        self.P_F_SST_F_TANG = table.P_F_SST_F_TANG
        self.R_F_ST_I0 = table.R_F_ST_I0
        self.R_F_ST_KP = table.R_F_ST_KP
        self.R_F_ST_KV = table.R_F_ST_KV
        self.R_F_PP_PHI = table.R_F_PP_PHI
        self.R_F_PP_I0 = table.R_F_PP_I0
        self.R_F_PP_DW = table.R_F_PP_DW
        self.R_F_PP_KV = table.R_F_PP_KV
        self.R_F_PU_I0 = table.R_F_PU_I0
        self.R_F_PU_DW = table.R_F_PU_DW
        self.R_F_PU_KV = table.R_F_PU_KV
        self.R_F_PU_ANG = table.R_F_PU_ANG
        self.R_F_PU_TIME = table.R_F_PU_TIME
        self.R_F_FU_I0 = table.R_F_FU_I0
        self.R_F_FU_KP = table.R_F_FU_KP
        self.R_F_FU_KV = table.R_F_FU_KV
        self.R_F_FD_PHI = table.R_F_FD_PHI
        self.R_F_FD_Q3 = table.R_F_FD_Q3
        self.R_F_FD_I0 = table.R_F_FD_I0
        self.R_F_FD_KP = table.R_F_FD_KP
        self.R_F_FD_KV = table.R_F_FD_KV
        self.motor_position = table_id(f"{board}_MOTOR_POSITION")
        self.own_angle = table_id("E_LI_ANGLE" if inner else "E_LO_ANGLE")
        self.other_angle = table_id("E_LO_ANGLE" if inner else "E_LI_ANGLE")
        self.push_to_strike = table_id(f"E_{own}_PP2HS_TIME")
        self.missed_pushes = table_id(f"E_{own}_PP_MISSED")
        self.state_number = table_id(f"FSM_{own}")
        motor: object = MotorCommand(store, board)  # untyped, so that its methods are plain ones
        self.motor = motor
        self.prepush_ms = 0
        self.push_ms = 0
        self.machine = StateMachine(
            "inner foot" if inner else "outer foot",
            states=(
                #     no. name        entry               main
                State(0, "start", None, self.flip_down if inner else self.hold_standing),
                State(1, "stance", None, self.stand),
                State(2, "prepush", self.enter_prepush, self.prepare_push),
                State(3, "push", self.enter_push, self.push),
                State(4, "flipup", None, self.flip_up),
                State(5, "flipdown", None, self.flip_down),
            ),
            transitions=(
                # from                           to         when
                (ANY, "start", self.reset_wanted),
                ("start", "stance", self.own_foot_struck) if inner else ("start", "flipup", self.other_foot_struck),
                (("stance", "prepush"), "push", self.other_foot_struck),
                ("stance", "prepush", self.leg_leans_far_enough),
                ("push", "flipup", self.push_is_done),
                (("flipup", "flipdown"), "stance", self.own_foot_struck),
                ("flipup", "flipdown", self.leg_swung_far_enough),
            ),
            on_change=self.publish_state,
        )

    @cython.ccall
    def publish_state(self, number) -> None:
        self.store.set_int(self.state_number, number)

    # -- actions ---------------------------------------------------------------------------------

    @cython.ccall
    def send(self, I0: cython.double, Kp: cython.double, Kv: cython.double) -> None:
        """I = I0 + Kp q_m + Kv q_m', in A, A/rad, A s/rad."""
        self.motor.send(I0 - Kp * self.zero, -Kp, -Kv)

    @cython.ccall
    def hold_standing(self) -> None:
        """Outer start: stiff, by the hip angle alone."""
        store: DataStore = self.store
        stiffness: float = store.get_float(self.C_F_SST_F_ANG)
        self.motor.send(
            stiffness * (store.get_float(self.P_F_SST_F_TANG) - 0.5 * store.get_float(self.MCH_ANGLE)),
            stiffness,
            store.get_float(self.C_F_SST_F_RATE),
        )

    @cython.ccall
    def stand(self) -> None:
        store: DataStore = self.store
        self.send(
            store.get_float(self.R_F_ST_I0),
            store.get_float(self.R_F_ST_KP),
            store.get_float(self.R_F_ST_KV),
        )

    @cython.ccall
    def enter_prepush(self) -> None:
        self.prepush_ms = 0

    @cython.ccall
    def prepare_push(self) -> None:
        """The ankle pushes while the other foot comes down."""
        store: DataStore = self.store
        self.prepush_ms += 2
        self.send(
            store.get_float(self.R_F_PP_I0) + store.get_float(self.R_F_PP_DW) * store.get_float(self.E_R_DW),
            0.0,
            store.get_float(self.R_F_PP_KV),
        )

    @cython.ccall
    def enter_push(self) -> None:
        """The other foot has landed; a push that was not prepared is counted as missed, as in the record walk."""
        store: DataStore = self.store
        self.push_ms = 0
        if self.prepush_ms == 0:
            store.set_int(self.missed_pushes, store.get_int(self.missed_pushes) + 1)
        store.set_int(self.push_to_strike, self.prepush_ms)
        self.prepush_ms = 0

    @cython.ccall
    def push(self) -> None:
        store: DataStore = self.store
        self.push_ms += 2
        self.send(
            store.get_float(self.R_F_PU_I0) + store.get_float(self.R_F_PU_DW) * store.get_float(self.E_R_DW),
            0.0,
            store.get_float(self.R_F_PU_KV),
        )

    @cython.ccall
    def flip_up(self) -> None:
        store: DataStore = self.store
        self.send(
            store.get_float(self.R_F_FU_I0),
            store.get_float(self.R_F_FU_KP),
            store.get_float(self.R_F_FU_KV),
        )

    @cython.ccall
    def flip_down(self) -> None:
        store: DataStore = self.store
        self.send(
            store.get_float(self.R_F_FD_I0),
            store.get_float(self.R_F_FD_KP),
            store.get_float(self.R_F_FD_KV),
        )

    # -- conditions ------------------------------------------------------------------------------

    @cython.ccall
    def reset_wanted(self) -> cython.bint:
        return self.store.get_int(self.FSM_RESET) == 1

    @cython.ccall
    def own_foot_struck(self) -> cython.bint:
        return self.store.get_int(self.E_SWING_LEG) != self.own_swing

    @cython.ccall
    def other_foot_struck(self) -> cython.bint:
        return self.store.get_int(self.E_SWING_LEG) == self.own_swing

    @cython.ccall
    def leg_leans_far_enough(self) -> cython.bint:
        """phi < b."""
        return -self.store.get_float(self.own_angle) < self.store.get_float(self.R_F_PP_PHI)

    @cython.ccall
    def push_is_done(self) -> cython.bint:
        """The motor has turned far enough, or for long enough."""
        store: DataStore = self.store
        return store.get_float(self.motor_position) - self.zero > store.get_float(
            self.R_F_PU_ANG
        ) or self.push_ms >= store.get_float(self.R_F_PU_TIME)

    @cython.ccall
    def leg_swung_far_enough(self) -> cython.bint:
        """phi < c and q3 < e, of the leg that stands now."""
        store: DataStore = self.store
        return -store.get_float(self.other_angle) < store.get_float(self.R_F_FD_PHI) and (
            -self.hip_sign * store.get_float(self.MCH_ANGLE) < store.get_float(self.R_F_FD_Q3)
        )


READS = variables_of(ReflexFootMachine)
