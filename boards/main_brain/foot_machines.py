"""The machines of the two ankle motors, from one description.

Source: robot.md C1.5. Written for the foot pair that the machine drives ("own") and the other one;
the hip angle is taken with the sign that makes it positive while the own legs are ahead. Differences:
the inner feet start flipped down in the air, the outer ones start standing, and skip their first push.
"""

import cython

from ranger_sim.boards.main_brain.command import MotorCommand, table_id, variables_of
from ranger_sim.boards.main_brain.state_machine import ANY, State, StateMachine
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.store import DataStore

# Parameters that are separate for each pair.
OF_ONE_PAIR = ("P_FO_PP_THEIGHT", "P_FI_PP_THEIGHT")


@cython.cclass
class FootMachine:
    """inner: True for the inner ankles. `machine` is stepped after the hip machine, inner feet first.

    States 0 start ... 6 stop; the start state is startflipdown (inner) or startstance (outer).
    More than 40 fields, because most are the ids of its variables in the data table, which compiled code then finds
    without a dictionary.
    """

    store: DataStore
    inner: cython.bint
    wait_for_strike: cython.bint
    strike_logged: cython.bint
    hip_sign: cython.double
    hip_margin: cython.double
    push_gain: cython.double
    push_base: cython.double
    push_angle: cython.double
    push_start: cython.double
    turned: cython.double
    own_swing: cython.longlong
    push_ms: cython.longlong
    passive_ms: cython.longlong
    # variables of the data table
    MCH_ANGLE: cython.longlong
    E_SWING_LEG: cython.longlong
    E_ANKLE_HEIGHT: cython.longlong
    E_AM_L_ABSRATE: cython.longlong
    FSM_RESET: cython.longlong
    C_F_ST_F_ANG: cython.longlong
    C_F_ST_F_RATE: cython.longlong
    P_F_ST_F_TANG: cython.longlong
    C_F_PP_F_ANG: cython.longlong
    C_F_PP_F_RATE: cython.longlong
    P_F_PP_F_TANG: cython.longlong
    P_F_PP_FRAC_ANG: cython.longlong
    P_F_PP_F_ABSANG: cython.longlong
    C_F_FU_F_ANG: cython.longlong
    C_F_FU_F_RATE: cython.longlong
    P_F_FU_F_TANG: cython.longlong
    P_F_FU_H_ANG: cython.longlong
    P_F_FU_F_CABL_STRETCH: cython.longlong
    C_F_FD_F_ANG: cython.longlong
    C_F_FD_F_RATE: cython.longlong
    P_F_FD_F_TANG: cython.longlong
    C_F_SST_F_ANG: cython.longlong
    C_F_SST_F_RATE: cython.longlong
    P_F_SST_F_TANG: cython.longlong
    P_F_AP_TIME: cython.longlong
    D_F_ON: cython.longlong
    DP_F_PP_L_ABSRATE: cython.longlong
    DP_H_AM_L_ABSRATE: cython.longlong
    DC_F_PP_L_ABSRATE: cython.longlong
    DC_F_PP_L_ABSRATE2: cython.longlong
    motor_position: cython.longlong
    ankle_angle: cython.longlong
    own_absolute: cython.longlong
    other_absolute: cython.longlong
    push_height: cython.longlong
    push_to_strike: cython.longlong
    missed_pushes: cython.longlong
    state_number: cython.longlong
    motor: MotorCommand
    machine: StateMachine

    def __init__(self, store, quirks, inner: cython.bint) -> None:
        own, other, board, ankle = (
            ("FI", "FO", "MCFI", "MCFI_MID_ANKLE_ANGLE") if inner else ("FO", "FI", "MCFO", "MCFO_RIGHT_ANKLE_ANGLE")
        )
        self.store = store
        self.inner = inner
        self.wait_for_strike = quirks.push_correction_after_strike
        self.hip_sign = 1.0 if inner else -1.0
        self.own_swing = 1 if inner else 0  # value of E_SWING_LEG while the own legs swing
        self.MCH_ANGLE = table.MCH_ANGLE
        self.E_SWING_LEG = table.E_SWING_LEG
        self.E_ANKLE_HEIGHT = table.E_ANKLE_HEIGHT
        self.E_AM_L_ABSRATE = table.E_AM_L_ABSRATE
        self.FSM_RESET = table.FSM_RESET
        self.C_F_ST_F_ANG = table.C_F_ST_F_ANG
        self.C_F_ST_F_RATE = table.C_F_ST_F_RATE
        self.P_F_ST_F_TANG = table.P_F_ST_F_TANG
        self.C_F_PP_F_ANG = table.C_F_PP_F_ANG
        self.C_F_PP_F_RATE = table.C_F_PP_F_RATE
        self.P_F_PP_F_TANG = table.P_F_PP_F_TANG
        self.P_F_PP_FRAC_ANG = table.P_F_PP_FRAC_ANG
        self.P_F_PP_F_ABSANG = table.P_F_PP_F_ABSANG
        self.C_F_FU_F_ANG = table.C_F_FU_F_ANG
        self.C_F_FU_F_RATE = table.C_F_FU_F_RATE
        self.P_F_FU_F_TANG = table.P_F_FU_F_TANG
        self.P_F_FU_H_ANG = table.P_F_FU_H_ANG
        self.P_F_FU_F_CABL_STRETCH = table.P_F_FU_F_CABL_STRETCH
        self.C_F_FD_F_ANG = table.C_F_FD_F_ANG
        self.C_F_FD_F_RATE = table.C_F_FD_F_RATE
        self.P_F_FD_F_TANG = table.P_F_FD_F_TANG
        self.C_F_SST_F_ANG = table.C_F_SST_F_ANG
        self.C_F_SST_F_RATE = table.C_F_SST_F_RATE
        self.P_F_SST_F_TANG = table.P_F_SST_F_TANG
        self.P_F_AP_TIME = table.P_F_AP_TIME
        self.D_F_ON = table.D_F_ON
        self.DP_F_PP_L_ABSRATE = table.DP_F_PP_L_ABSRATE
        self.DP_H_AM_L_ABSRATE = table.DP_H_AM_L_ABSRATE
        self.DC_F_PP_L_ABSRATE = table.DC_F_PP_L_ABSRATE
        self.DC_F_PP_L_ABSRATE2 = table.DC_F_PP_L_ABSRATE2
        self.motor_position = table_id(f"{board}_MOTOR_POSITION")
        self.ankle_angle = table_id(ankle)
        self.own_absolute = table_id(f"E_{own}_ABSANG")
        self.other_absolute = table_id(f"E_{other}_ABSANG")
        self.push_height = table_id(f"P_{own}_PP_THEIGHT")
        self.push_to_strike = table_id(f"E_{own}_PP2HS_TIME")
        self.missed_pushes = table_id(f"E_{own}_PP_MISSED")
        self.state_number = table_id(f"FSM_{own}")
        motor: object = MotorCommand(store, board)  # untyped, so that its methods are plain ones
        self.motor = motor
        self.hip_margin = 0.05  # rad, a literal of the original: own legs this far behind before a push
        self.push_gain = 0.0  # A/rad added at prepush entry
        self.push_base = 0.0  # rad beyond the stance angle, read at prepush entry
        self.push_angle = 0.0  # rad added at prepush entry
        self.push_start = 0.0  # published angle at prepush entry, rad
        self.turned = 0.0  # since then, rad, by the last main action
        self.push_ms = 0
        self.strike_logged = False
        self.passive_ms = 0
        start = "startflipdown" if inner else "startstance"
        self.machine = StateMachine(
            "inner foot" if inner else "outer foot",
            states=(
                #     no. name         entry               main
                State(0, start, None, self.hold_flipped_down if inner else self.hold_standing),
                State(1, "stance", None, self.track_stance),
                State(2, "prepush", self.enter_prepush, self.push),
                State(3, "afterpush", self.enter_afterpush, self.go_limp),
                State(4, "flipup", None, self.flip_up),
                State(5, "flipdown", None, self.flip_down),
                State(6, "stop", None, motor.off),
            ),
            transitions=(
                # from         to           when
                ("stance", "prepush", self.push_is_due),
                ("prepush", "afterpush", self.push_is_done),
                ("afterpush", "flipup", self.cable_is_slack_enough),
                ("flipup", "flipdown", self.own_leg_is_ahead),
                ("flipdown", "stance", self.own_foot_struck),
                (start, "stance", self.own_foot_struck) if inner else (start, "flipup", self.other_foot_struck),
                (ANY, start, self.reset_wanted),
            ),
            on_change=self.publish_state,
        )

    @cython.ccall
    def publish_state(self, number) -> None:
        self.store.set_int(self.state_number, number)

    # -- actions ---------------------------------------------------------------------------------

    @cython.ccall
    def track_absolute(self, target: cython.double, stiffness: cython.double, dampness: cython.double) -> None:
        """Hold the foot's angle to the floor: the target is renewed from the pose each tick."""
        self.motor.send(
            stiffness * (target + self.store.get_float(self.motor_position) - self.store.get_float(self.own_absolute)),
            stiffness,
            dampness,
        )

    @cython.ccall
    def track_motor(self, target: cython.double, stiffness: cython.double, dampness: cython.double) -> None:
        """Hold the motor's angle to the leg."""
        self.motor.send(stiffness * target, stiffness, dampness)

    @cython.ccall
    def hold_flipped_down(self) -> None:
        """Inner start: foot parallel to the floor by the hip angle alone, no use of the IMU."""
        store: DataStore = self.store
        self.track_motor(
            store.get_float(self.P_F_FD_F_TANG) + 0.5 * store.get_float(self.MCH_ANGLE),
            store.get_float(self.C_F_FD_F_ANG),
            store.get_float(self.C_F_FD_F_RATE),
        )

    @cython.ccall
    def hold_standing(self) -> None:
        """Outer start: stiff, by the hip angle alone."""
        store: DataStore = self.store
        self.track_motor(
            store.get_float(self.P_F_SST_F_TANG) - 0.5 * store.get_float(self.MCH_ANGLE),
            store.get_float(self.C_F_SST_F_ANG),
            store.get_float(self.C_F_SST_F_RATE),
        )

    @cython.ccall
    def track_stance(self) -> None:
        store: DataStore = self.store
        self.track_absolute(
            store.get_float(self.P_F_ST_F_TANG),
            store.get_float(self.C_F_ST_F_ANG),
            store.get_float(self.C_F_ST_F_RATE),
        )

    @cython.ccall
    def enter_prepush(self) -> None:
        """Fix this push: stronger and longer after a slow mid-stance.

        The gain refers to the nominal rate (0.72) but switches at another one (0.65), so the push jumps
        by 0.35 A/rad and 0.035 rad there, as on the robot.
        """
        store: DataStore = self.store
        v: float = store.get_float(self.E_AM_L_ABSRATE)
        deficit: float
        self.push_gain = 0.0
        self.push_angle = 0.0
        if store.get_float(self.D_F_ON) != 0.0 and v < store.get_float(self.DP_F_PP_L_ABSRATE):
            deficit = store.get_float(self.DP_H_AM_L_ABSRATE) - v
            self.push_gain = store.get_float(self.DC_F_PP_L_ABSRATE) * deficit
            self.push_angle = store.get_float(self.DC_F_PP_L_ABSRATE2) * deficit
        self.push_base = store.get_float(self.P_F_PP_F_TANG)
        self.push_start = store.get_float(self.own_absolute)
        self.turned = 0.0
        self.push_ms = 0
        self.strike_logged = False
        if self.other_foot_struck():
            store.set_int(self.missed_pushes, store.get_int(self.missed_pushes) + 1)

    @cython.ccall
    def push(self) -> None:
        store: DataStore = self.store
        if not self.strike_logged and self.other_foot_struck():
            self.strike_logged = True
            store.set_int(self.push_to_strike, self.push_ms)
        self.push_ms += 2
        self.turned = store.get_float(self.own_absolute) - self.push_start
        self.track_absolute(
            store.get_float(self.P_F_ST_F_TANG) + self.push_target(),
            store.get_float(self.C_F_PP_F_ANG) + (self.push_gain if self.correction_applies() else 0.0),
            store.get_float(self.C_F_PP_F_RATE),
        )

    @cython.ccall
    def correction_applies(self) -> cython.bint:
        """A variant dated 25 April 2011 lets the correction wait for the heel strike."""
        return self.strike_logged or not self.wait_for_strike

    @cython.ccall
    def push_target(self) -> cython.double:
        """How far beyond the stance angle the foot is to turn, rad."""
        if self.correction_applies():
            return self.push_base + self.push_angle
        return self.push_base

    @cython.ccall
    def enter_afterpush(self) -> None:
        self.passive_ms = 0

    @cython.ccall
    def go_limp(self) -> None:
        self.passive_ms += 2
        self.motor.off()

    @cython.ccall
    def flip_up(self) -> None:
        store: DataStore = self.store
        self.track_motor(
            store.get_float(self.P_F_FU_F_TANG),
            store.get_float(self.C_F_FU_F_ANG),
            store.get_float(self.C_F_FU_F_RATE),
        )

    @cython.ccall
    def flip_down(self) -> None:
        store: DataStore = self.store
        self.track_absolute(
            store.get_float(self.P_F_FD_F_TANG),
            store.get_float(self.C_F_FD_F_ANG),
            store.get_float(self.C_F_FD_F_RATE),
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
    def push_is_due(self) -> cython.bint:
        """Own legs well behind, and the other foot about to land (flipped down and low) or landed."""
        store: DataStore = self.store
        if self.hip_sign * store.get_float(self.MCH_ANGLE) >= -self.hip_margin:
            return False
        if self.other_foot_struck():
            return True
        return store.get_float(self.E_ANKLE_HEIGHT) < store.get_float(self.push_height) and store.get_float(
            self.other_absolute
        ) > store.get_float(self.P_F_PP_F_ABSANG)

    @cython.ccall
    def push_is_done(self) -> cython.bint:
        """Struck, and turned by a part of the push when last looked at.

        The variant that waits for the strike counts its correction twice here, as the robot's did.
        """
        whole: float = self.push_base + self.push_angle
        if self.wait_for_strike and self.strike_logged:
            whole = whole + self.push_angle
        return self.other_foot_struck() and self.turned > self.store.get_float(self.P_F_PP_FRAC_ANG) * whole

    @cython.ccall
    def cable_is_slack_enough(self) -> cython.bint:
        store: DataStore = self.store
        stretch: float = store.get_float(self.motor_position) - store.get_float(self.ankle_angle)
        return stretch <= store.get_float(self.P_F_FU_F_CABL_STRETCH) or self.passive_ms >= store.get_float(
            self.P_F_AP_TIME
        )

    @cython.ccall
    def own_leg_is_ahead(self) -> cython.bint:
        store: DataStore = self.store
        return self.hip_sign * store.get_float(self.MCH_ANGLE) > store.get_float(self.P_F_FU_H_ANG)


READS = variables_of(FootMachine) + OF_ONE_PAIR
