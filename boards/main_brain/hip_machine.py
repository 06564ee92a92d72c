"""The hip machine: swings the legs, holds them in an emergency, corrects once per step.

Source: robot.md C1.4. In the states' names HI means inner legs in the air and outer ones on
the ground, HO the reverse.
The entry current H_TEST1 of the preswing states is not here: it was 0, and the main action of the same
tick overwrites it before anything is sent. The premid discrete controller (D_H2_ON) is not here either:
it was off and all its gains were 0.
"""

import cython

from ranger_sim.boards.main_brain.command import MotorCommand, variables_of
from ranger_sim.boards.main_brain.state_machine import State, StateMachine
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.store import DataStore


@cython.cclass
class HipMachine:
    """States 0 HI_starthold ... 9 stop; `machine` is stepped after the leg machine.

    More than 40 fields, because most are the ids of its variables in the data table, which compiled code then finds
    without a dictionary.
    """

    store: DataStore
    # ids of the variables of the data table, by their names
    MCH_ANGLE: cython.longlong
    E_MCH_ANG_RATE: cython.longlong
    E_LO_ANGLE: cython.longlong
    E_LI_ANGLE: cython.longlong
    E_SWING_LEG: cython.longlong
    E_T_AFTER_HS: cython.longlong
    E_AM_L_ABSRATE: cython.longlong
    E_AM_H_ANG: cython.longlong
    E_AM_H_RATE: cython.longlong
    E_AM_TIMER: cython.longlong
    MCFO_RIGHT_ANKLE_RATE: cython.longlong
    MCFI_ANKLE_RATE: cython.longlong
    FSM_LEG: cython.longlong
    FSM_RESET: cython.longlong
    C_H_OUTER_STIFFNESS: cython.longlong
    C_H_PM_H_RATE: cython.longlong
    P_H_PM_H_TRATE: cython.longlong
    P_H_PM_TIME: cython.longlong
    P_H_PM_F_RATE: cython.longlong
    C_HI_SH_H_ANG: cython.longlong
    C_HI_SH_H_RATE: cython.longlong
    P_HI_SH_H_TANG: cython.longlong
    C_H_EH_H_ANG: cython.longlong
    C_H_EH_H_RATE: cython.longlong
    P_H_EH_H_TANG: cython.longlong
    P_H_EHOLD_ANG: cython.longlong
    P_H_EHOLD_ANG2: cython.longlong
    P_H_EH_L_TRATE: cython.longlong
    D_H_ON: cython.longlong
    DP_F_PP_L_ABSRATE: cython.longlong
    DP_H_AM_H_ANG: cython.longlong
    DP_H_AM_L_ABSRATE: cython.longlong
    DP_H_AM_H_RATE: cython.longlong
    DP_H_AM_TIME1: cython.longlong
    DP_H_AM_TIME2: cython.longlong
    DC2_H_AM_H_ANG1: cython.longlong
    DC2_H_AM_H_ANG2: cython.longlong
    DC2_H_AM_H_RATE1: cython.longlong
    DC2_H_AM_H_RATE2: cython.longlong
    DC3_H_AM_H_ANG1: cython.longlong
    DC3_H_AM_H_ANG2: cython.longlong
    DC3_H_AM_L_ABSRATE1: cython.longlong
    DC3_H_AM_L_ABSRATE2: cython.longlong
    DC3_H_AM_H_RATE1: cython.longlong
    DC3_H_AM_H_RATE2: cython.longlong
    E_H_DI1: cython.longlong
    E_H_DI2: cython.longlong
    FSM_HIP: cython.longlong
    motor: MotorCommand
    premid_time: cython.longlong
    leg_lo_aftermid: cython.longlong
    leg_li_aftermid: cython.longlong
    first_correction: cython.double
    second_correction: cython.double
    machine: StateMachine

    def __init__(self, store) -> None:
        self.store = store
        self.MCH_ANGLE = table.MCH_ANGLE
        self.E_MCH_ANG_RATE = table.E_MCH_ANG_RATE
        self.E_LO_ANGLE = table.E_LO_ANGLE
        self.E_LI_ANGLE = table.E_LI_ANGLE
        self.E_SWING_LEG = table.E_SWING_LEG
        self.E_T_AFTER_HS = table.E_T_AFTER_HS
        self.E_AM_L_ABSRATE = table.E_AM_L_ABSRATE
        self.E_AM_H_ANG = table.E_AM_H_ANG
        self.E_AM_H_RATE = table.E_AM_H_RATE
        self.E_AM_TIMER = table.E_AM_TIMER
        self.MCFO_RIGHT_ANKLE_RATE = table.MCFO_RIGHT_ANKLE_RATE
        self.MCFI_ANKLE_RATE = table.MCFI_ANKLE_RATE
        self.FSM_LEG = table.FSM_LEG
        self.FSM_RESET = table.FSM_RESET
        self.C_H_OUTER_STIFFNESS = table.C_H_OUTER_STIFFNESS
        self.C_H_PM_H_RATE = table.C_H_PM_H_RATE
        self.P_H_PM_H_TRATE = table.P_H_PM_H_TRATE
        self.P_H_PM_TIME = table.P_H_PM_TIME
        self.P_H_PM_F_RATE = table.P_H_PM_F_RATE
        self.C_HI_SH_H_ANG = table.C_HI_SH_H_ANG
        self.C_HI_SH_H_RATE = table.C_HI_SH_H_RATE
        self.P_HI_SH_H_TANG = table.P_HI_SH_H_TANG
        self.C_H_EH_H_ANG = table.C_H_EH_H_ANG
        self.C_H_EH_H_RATE = table.C_H_EH_H_RATE
        self.P_H_EH_H_TANG = table.P_H_EH_H_TANG
        self.P_H_EHOLD_ANG = table.P_H_EHOLD_ANG
        self.P_H_EHOLD_ANG2 = table.P_H_EHOLD_ANG2
        self.P_H_EH_L_TRATE = table.P_H_EH_L_TRATE
        self.D_H_ON = table.D_H_ON
        self.DP_F_PP_L_ABSRATE = table.DP_F_PP_L_ABSRATE
        self.DP_H_AM_H_ANG = table.DP_H_AM_H_ANG
        self.DP_H_AM_L_ABSRATE = table.DP_H_AM_L_ABSRATE
        self.DP_H_AM_H_RATE = table.DP_H_AM_H_RATE
        self.DP_H_AM_TIME1 = table.DP_H_AM_TIME1
        self.DP_H_AM_TIME2 = table.DP_H_AM_TIME2
        self.DC2_H_AM_H_ANG1 = table.DC2_H_AM_H_ANG1
        self.DC2_H_AM_H_ANG2 = table.DC2_H_AM_H_ANG2
        self.DC2_H_AM_H_RATE1 = table.DC2_H_AM_H_RATE1
        self.DC2_H_AM_H_RATE2 = table.DC2_H_AM_H_RATE2
        self.DC3_H_AM_H_ANG1 = table.DC3_H_AM_H_ANG1
        self.DC3_H_AM_H_ANG2 = table.DC3_H_AM_H_ANG2
        self.DC3_H_AM_L_ABSRATE1 = table.DC3_H_AM_L_ABSRATE1
        self.DC3_H_AM_L_ABSRATE2 = table.DC3_H_AM_L_ABSRATE2
        self.DC3_H_AM_H_RATE1 = table.DC3_H_AM_H_RATE1
        self.DC3_H_AM_H_RATE2 = table.DC3_H_AM_H_RATE2
        self.E_H_DI1 = table.E_H_DI1
        self.E_H_DI2 = table.E_H_DI2
        self.FSM_HIP = table.FSM_HIP
        motor: object = MotorCommand(store, "MCH")  # untyped, so that its methods are plain ones
        self.motor = motor
        self.premid_time = 0  # ms after heel strike at which premid began
        self.first_correction = 0.0  # A
        self.second_correction = 0.0  # A
        self.leg_lo_aftermid = 5  # numbers of the leg machine's states
        self.leg_li_aftermid = 2
        self.machine = StateMachine(
            "hip",
            states=(
                #     no. name             entry               main
                State(0, "HI_starthold", None, self.hold_start),
                State(1, "HO_preswing", None, motor.off),
                State(2, "HO_premid", self.enter_premid, self.swing_outer),
                State(3, "HO_aftermid", self.enter_aftermid, self.swing_outer_corrected),
                State(4, "HI_preswing", None, motor.off),
                State(5, "HI_premid", self.enter_premid, self.swing_inner),
                State(6, "HI_aftermid", self.enter_aftermid, self.swing_inner_corrected),
                State(7, "HI_ehold", None, self.hold_inner_ahead),
                State(8, "HO_ehold", None, self.hold_outer_ahead),
                State(9, "stop", None, motor.off),
            ),
            transitions=(
                # from                            to             when
                ("HI_starthold", "HO_preswing", self.inner_struck),
                ("HO_preswing", "HO_premid", self.outer_foot_flips_up),
                ("HO_premid", "HO_aftermid", self.inner_stance_past_mid),
                (("HO_aftermid", "HO_ehold"), "HI_preswing", self.outer_struck),
                ("HI_preswing", "HI_premid", self.inner_foot_flips_up),
                ("HI_premid", "HI_aftermid", self.outer_stance_past_mid),
                (("HI_aftermid", "HI_ehold"), "HO_preswing", self.inner_struck),
                (("HI_premid", "HI_aftermid"), "HI_ehold", self.inner_leg_hangs),
                (("HO_premid", "HO_aftermid"), "HO_ehold", self.outer_leg_hangs),
                (NOT_STOP, "HI_starthold", self.reset_wanted),
            ),
            on_change=self.publish_state,
        )

    @cython.ccall
    def publish_state(self, number) -> None:
        self.store.set_int(self.FSM_HIP, number)

    # -- actions ---------------------------------------------------------------------------------

    @cython.ccall
    def hold_start(self) -> None:
        """Hold the inner legs ahead until the first heel strike."""
        stiffness: float = self.store.get_float(self.C_HI_SH_H_ANG)
        self.motor.send(
            stiffness * self.store.get_float(self.P_HI_SH_H_TANG),
            stiffness,
            self.store.get_float(self.C_HI_SH_H_RATE),
        )

    @cython.ccall
    def hold_inner_ahead(self) -> None:
        stiffness: float = self.store.get_float(self.C_H_EH_H_ANG)
        self.motor.send(
            stiffness * self.store.get_float(self.P_H_EH_H_TANG),
            stiffness,
            self.store.get_float(self.C_H_EH_H_RATE),
        )

    @cython.ccall
    def hold_outer_ahead(self) -> None:
        stiffness: float = self.store.get_float(self.C_H_EH_H_ANG)
        self.motor.send(
            -stiffness * self.store.get_float(self.P_H_EH_H_TANG),
            stiffness,
            self.store.get_float(self.C_H_EH_H_RATE),
        )

    @cython.ccall
    def enter_premid(self) -> None:
        self.premid_time = self.store.get_int(self.E_T_AFTER_HS)

    @cython.ccall
    def enter_aftermid(self) -> None:
        """The discrete corrections of this step from the figures of mid-stance."""
        store: DataStore = self.store
        mode: float = store.get_float(self.D_H_ON)
        v: float = store.get_float(self.E_AM_L_ABSRATE)
        angle: float = store.get_float(self.E_AM_H_ANG) - store.get_float(self.DP_H_AM_H_ANG)
        rate: float = store.get_float(self.E_AM_H_RATE) - store.get_float(self.DP_H_AM_H_RATE)
        slow: cython.bint
        if mode == 0.0:
            self.first_correction = 0.0
            self.second_correction = 0.0
        else:
            slow = v < store.get_float(self.DP_F_PP_L_ABSRATE)
            if mode == 2.0:
                slow = True
            elif mode == 3.0:
                slow = False
            if slow:
                self.first_correction = -(
                    store.get_float(self.DC2_H_AM_H_ANG1) * angle + store.get_float(self.DC2_H_AM_H_RATE1) * rate
                )
                self.second_correction = -(
                    store.get_float(self.DC2_H_AM_H_ANG2) * angle + store.get_float(self.DC2_H_AM_H_RATE2) * rate
                )
            else:
                v = v - store.get_float(self.DP_H_AM_L_ABSRATE)
                self.first_correction = -(
                    store.get_float(self.DC3_H_AM_H_ANG1) * angle
                    + store.get_float(self.DC3_H_AM_L_ABSRATE1) * v
                    + store.get_float(self.DC3_H_AM_H_RATE1) * rate
                )
                self.second_correction = -(
                    store.get_float(self.DC3_H_AM_H_ANG2) * angle
                    + store.get_float(self.DC3_H_AM_L_ABSRATE2) * v
                    + store.get_float(self.DC3_H_AM_H_RATE2) * rate
                )
        store.set_float(self.E_H_DI1, self.first_correction)
        store.set_float(self.E_H_DI2, self.second_correction)

    @cython.ccall
    def correction(self) -> cython.double:
        """The correction in force now, A."""
        timer: float = self.store.get_int(self.E_AM_TIMER)
        if timer < self.store.get_float(self.DP_H_AM_TIME1):
            return self.first_correction
        if timer < self.store.get_float(self.DP_H_AM_TIME2):
            return self.second_correction
        return 0.0

    @cython.ccall
    def base_current(self, direction: cython.double) -> cython.double:
        """Rate control of the swing, one-sided, within the window after premid began; A.

        direction: +1 for the inner legs swinging, -1 for the outer ones.
        """
        store: DataStore = self.store
        elapsed: float = store.get_int(self.E_T_AFTER_HS) - self.premid_time
        current: float
        if elapsed >= store.get_float(self.P_H_PM_TIME):
            return 0.0
        current = store.get_float(self.C_H_PM_H_RATE) * (
            direction * store.get_float(self.P_H_PM_H_TRATE) - store.get_float(self.E_MCH_ANG_RATE)
        )
        if current * direction < 0.0:
            return 0.0
        return current

    @cython.ccall
    def swing_inner(self) -> None:
        self.motor.send(self.base_current(1.0), 0.0, 0.0)

    @cython.ccall
    def swing_inner_corrected(self) -> None:
        self.motor.send(self.base_current(1.0) + self.correction(), 0.0, 0.0)

    @cython.ccall
    def swing_outer(self) -> None:
        self.motor.send(self.base_current(-1.0), self.store.get_float(self.C_H_OUTER_STIFFNESS), 0.0)

    @cython.ccall
    def swing_outer_corrected(self) -> None:
        self.motor.send(
            self.base_current(-1.0) - self.correction(),
            self.store.get_float(self.C_H_OUTER_STIFFNESS),
            0.0,
        )

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
    def inner_foot_flips_up(self) -> cython.bint:
        return self.store.get_float(self.MCFI_ANKLE_RATE) < -self.store.get_float(self.P_H_PM_F_RATE)

    @cython.ccall
    def outer_foot_flips_up(self) -> cython.bint:
        return self.store.get_float(self.MCFO_RIGHT_ANKLE_RATE) < -self.store.get_float(self.P_H_PM_F_RATE)

    @cython.ccall
    def outer_stance_past_mid(self) -> cython.bint:
        return self.store.get_float(self.E_LO_ANGLE) > 0.0 and self.store.get_int(self.FSM_LEG) == self.leg_lo_aftermid

    @cython.ccall
    def inner_stance_past_mid(self) -> cython.bint:
        return self.store.get_float(self.E_LI_ANGLE) > 0.0 and self.store.get_int(self.FSM_LEG) == self.leg_li_aftermid

    @cython.ccall
    def hangs(self, direction: cython.double) -> cython.bint:
        """The swing leg is far ahead in a slow walk, or is on its way back."""
        store: DataStore = self.store
        ahead: float = direction * store.get_float(self.MCH_ANGLE)
        if ahead > store.get_float(self.P_H_EHOLD_ANG) and store.get_float(self.E_AM_L_ABSRATE) < store.get_float(
            self.P_H_EH_L_TRATE
        ):
            return True
        return (
            0.0 < ahead < store.get_float(self.P_H_EHOLD_ANG2)
            and direction * store.get_float(self.E_MCH_ANG_RATE) < 0.0
        )

    @cython.ccall
    def inner_leg_hangs(self) -> cython.bint:
        return self.hangs(1.0)

    @cython.ccall
    def outer_leg_hangs(self) -> cython.bint:
        return self.hangs(-1.0)


NOT_STOP = (
    "HI_starthold",
    "HO_preswing",
    "HO_premid",
    "HO_aftermid",
    "HI_preswing",
    "HI_premid",
    "HI_aftermid",
    "HI_ehold",
    "HO_ehold",
)

READS = variables_of(HipMachine)
