"""The leg machine: which leg stands, how far the step is, and the figures of mid-stance.

Source: robot.md C1.3. It commands nothing. Its figures (stance leg rate v, hip angle alpha and hip
rate omega at mid-stance, each averaged over the last two steps) serve the discrete corrections of the
hip and foot machines, which run after it in the same tick.

Kept as the robot had them: omega is formed with the hip angle that the *same* leg had at its previous
mid-stance, because the newer one is stored afterwards; a heel strike before mid-stance leaves the
machine in premid until the stance leg is next upright.
"""

import cython

from ranger_sim.boards.main_brain.command import variables_of
from ranger_sim.boards.main_brain.state_machine import ANY, State, StateMachine
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.store import DataStore


@cython.cclass
class StanceLeg:
    """What is remembered of the steps in which one leg pair stands, and the actions that gather it.

    angle_id: the pair's absolute angle in the table; hip_sign: +1 for the outer pair, so that
    hip_sign * h is positive while the swing leg is ahead of the standing one. The figures outlive a walk.
    """

    owner: "LegMachine"
    store: DataStore
    other: "StanceLeg"
    angle_id: cython.longlong
    preswing_ms: cython.longlong
    hip_sign: cython.double
    strike_angle: cython.double
    ss0_angle: cython.double
    ss0_rate: cython.double
    mid_rate: cython.double
    mid_hip: cython.double
    mid_hip_rate: cython.double
    mid_time: cython.double

    def __init__(self, owner, angle_id, hip_sign: float) -> None:
        self.owner = owner
        self.store = owner.store
        self.other = None
        self.angle_id = angle_id
        self.hip_sign = hip_sign
        self.strike_angle = 0.0
        self.preswing_ms = 0
        self.ss0_angle = 0.0
        self.ss0_rate = 0.0
        self.mid_rate = 0.0
        self.mid_hip = 0.0
        self.mid_hip_rate = 0.0
        self.mid_time = 0.0

    @cython.ccall
    def angle_before_vertical(self) -> cython.double:
        """Stance leg angle A, positive before vertical, rad."""
        return -self.store.get_float(self.angle_id)

    @cython.ccall
    def hip_ahead(self) -> cython.double:
        """Hip angle, positive while the swing leg is ahead, rad."""
        return self.hip_sign * self.store.get_float(self.owner.MCH_ANGLE)

    @cython.ccall
    def enter_preswing(self) -> None:
        self.strike_angle = self.angle_before_vertical()
        self.preswing_ms = 0

    @cython.ccall
    def count_preswing(self) -> None:
        self.preswing_ms += 2

    @cython.ccall
    def leave_preswing(self) -> None:
        self.store.set_float(self.owner.E_PS_TIME, self.preswing_ms)

    @cython.ccall
    def enter_premid(self) -> None:
        """Single stance begins (SS0): remember the pose, publish the means over both legs."""
        self.ss0_angle = self.angle_before_vertical()
        self.owner.ss0_known = True
        self.owner.ss0_angle = self.ss0_angle
        self.owner.ss0_time = self.store.get_int(self.owner.E_T_AFTER_HS)
        self.owner.ss0_hip = self.hip_ahead()
        if self.preswing_ms > 0:
            self.ss0_rate = (self.strike_angle - self.ss0_angle) * 1000.0 / self.preswing_ms
        self.store.set_float(self.owner.E_SS_L_ANG, 0.5 * (self.ss0_angle + self.other.ss0_angle))
        self.store.set_float(self.owner.E_SS_L_ABSRATE, 0.5 * (self.ss0_rate + self.other.ss0_rate))

    @cython.ccall
    @cython.exceptval(check=True)
    def enter_aftermid(self) -> cython.void:
        """Mid-stance: rates by finite differences since SS0, averaged with the other leg's last ones.

        The span is negative when a strike came in between; the published rate then is the lowest. Before the first SS0
        the presets stay (see LegMachine.preset).
        ROBOT PARITY: a span of 0 is taken for 2 ms, where the robot divides by zero.
        """
        store: DataStore = self.store
        owner: LegMachine = self.owner
        span_ms: float = store.get_int(owner.E_T_AFTER_HS) - owner.ss0_time
        hip: float = self.hip_ahead()
        rate: float
        if not owner.ss0_known:
            return
        if span_ms == 0.0:
            span_ms = 2.0
        self.mid_rate = 1000.0 * owner.ss0_angle / span_ms
        if not owner.rate_of_previous_step:
            self.mid_hip = hip
        self.mid_hip_rate = (self.mid_hip - owner.ss0_hip) * 1000.0 / span_ms
        self.mid_hip = hip
        self.mid_time = span_ms
        rate = 0.5 * (self.mid_rate + self.other.mid_rate)
        if rate >= 1.5:
            rate = 1.5
        elif rate <= 0.0:
            rate = 0.01
        store.set_float(owner.E_AM_L_ABSRATE, rate)
        store.set_float(owner.E_AM_H_ANG, 0.5 * (self.mid_hip + self.other.mid_hip))
        store.set_float(owner.E_AM_H_RATE, 0.5 * (self.mid_hip_rate + self.other.mid_hip_rate))
        store.set_float(owner.E_AM_TIME, 0.5 * (self.mid_time + self.other.mid_time))


@cython.cclass
class LegMachine:
    """States 0 LI_preswing ... 6 stop; "LO" means that the outer legs stand. `machine` is stepped."""

    store: DataStore
    # variables of the data table
    E_LO_ANGLE: cython.longlong
    E_LI_ANGLE: cython.longlong
    E_SWING_LEG: cython.longlong
    E_T_AFTER_HS: cython.longlong
    MCH_ANGLE: cython.longlong
    MCFO_RIGHT_ANKLE_RATE: cython.longlong
    MCFI_ANKLE_RATE: cython.longlong
    FSM_RESET: cython.longlong
    P_H_PM_F_RATE: cython.longlong
    P_L_START_ABSRATE: cython.longlong
    P_L_START_H_RATE: cython.longlong
    E_AM_L_ABSRATE: cython.longlong
    E_AM_H_ANG: cython.longlong
    E_AM_H_RATE: cython.longlong
    E_AM_TIME: cython.longlong
    E_AM_TIMER: cython.longlong
    E_PS_TIME: cython.longlong
    E_SS_L_ANG: cython.longlong
    E_SS_L_ABSRATE: cython.longlong
    FSM_LEG: cython.longlong
    outer: StanceLeg
    inner: StanceLeg
    ss0_angle: cython.double
    ss0_hip: cython.double
    ss0_time: cython.longlong
    aftermid_ms: cython.longlong
    ss0_known: cython.bint
    rate_of_previous_step: cython.bint
    machine: StateMachine

    def __init__(self, store, quirks) -> None:
        self.store = store
        self.E_LO_ANGLE = table.E_LO_ANGLE
        self.E_LI_ANGLE = table.E_LI_ANGLE
        self.E_SWING_LEG = table.E_SWING_LEG
        self.E_T_AFTER_HS = table.E_T_AFTER_HS
        self.MCH_ANGLE = table.MCH_ANGLE
        self.MCFO_RIGHT_ANKLE_RATE = table.MCFO_RIGHT_ANKLE_RATE
        self.MCFI_ANKLE_RATE = table.MCFI_ANKLE_RATE
        self.FSM_RESET = table.FSM_RESET
        self.P_H_PM_F_RATE = table.P_H_PM_F_RATE
        self.P_L_START_ABSRATE = table.P_L_START_ABSRATE
        self.P_L_START_H_RATE = table.P_L_START_H_RATE
        self.E_AM_L_ABSRATE = table.E_AM_L_ABSRATE
        self.E_AM_H_ANG = table.E_AM_H_ANG
        self.E_AM_H_RATE = table.E_AM_H_RATE
        self.E_AM_TIME = table.E_AM_TIME
        self.E_AM_TIMER = table.E_AM_TIMER
        self.E_PS_TIME = table.E_PS_TIME
        self.E_SS_L_ANG = table.E_SS_L_ANG
        self.E_SS_L_ABSRATE = table.E_SS_L_ABSRATE
        self.FSM_LEG = table.FSM_LEG
        outer: object = StanceLeg(self, self.E_LO_ANGLE, 1.0)  # untyped, so that its methods are plain ones
        inner: object = StanceLeg(self, self.E_LI_ANGLE, -1.0)
        self.outer = outer
        self.inner = inner
        outer.other = inner
        inner.other = outer
        # pose at the last SS0, whichever leg stood
        self.ss0_known = False
        self.ss0_angle = 0.0
        self.ss0_time = 0
        self.ss0_hip = 0.0
        self.aftermid_ms = 0
        self.rate_of_previous_step = quirks.hip_mid_rate_of_previous_step
        self.machine = StateMachine(
            "leg",
            states=(
                #     no. name            entry                 main                  exit
                State(5, "LO_aftermid", outer.enter_aftermid, self.count_aftermid, self.leave_aftermid),
                State(0, "LI_preswing", inner.enter_preswing, inner.count_preswing, inner.leave_preswing),
                State(1, "LI_premid", inner.enter_premid),
                State(2, "LI_aftermid", inner.enter_aftermid, self.count_aftermid, self.leave_aftermid),
                State(3, "LO_preswing", outer.enter_preswing, outer.count_preswing, outer.leave_preswing),
                State(4, "LO_premid", outer.enter_premid),
                State(6, "stop"),
            ),
            transitions=(
                # from           to              when
                ("LO_preswing", "LO_premid", self.inner_foot_flips_up),
                ("LO_premid", "LO_aftermid", self.outer_leg_past_vertical),
                ("LO_aftermid", "LI_preswing", self.inner_struck),
                ("LI_preswing", "LI_premid", self.outer_foot_flips_up),
                ("LI_premid", "LI_aftermid", self.inner_leg_past_vertical),
                ("LI_aftermid", "LO_preswing", self.outer_struck),
                (ANY, "LO_aftermid", self.reset_wanted),
            ),
            on_change=self.publish_state,
        )

    @cython.ccall
    def preset(self) -> None:
        """A walk begins: the published rate; in the first walk also what both legs remember.

        ROBOT PARITY: the robot's legs remember zeros in the first walk after power-up and figures of the walk before in
        any other (robot.md C1.3). Our first walk begins like one of the others, with the presets remembered, because
        which of the two the record walk was is not known.
        """
        rate: float = self.store.get_float(self.P_L_START_ABSRATE)
        hip_rate: float = self.store.get_float(self.P_L_START_H_RATE)
        self.store.set_float(self.E_AM_L_ABSRATE, rate)
        if not self.ss0_known:
            self.outer.mid_rate = rate
            self.inner.mid_rate = rate
            self.outer.mid_hip_rate = hip_rate
            self.inner.mid_hip_rate = hip_rate
            self.store.set_float(self.E_AM_H_RATE, hip_rate)

    @cython.ccall
    def publish_state(self, number) -> None:
        self.store.set_int(self.FSM_LEG, number)

    @cython.ccall
    def count_aftermid(self) -> None:
        self.aftermid_ms += 2
        self.store.set_int(self.E_AM_TIMER, self.aftermid_ms)

    @cython.ccall
    def leave_aftermid(self) -> None:
        self.aftermid_ms = 0
        self.store.set_int(self.E_AM_TIMER, 0)

    @cython.ccall
    def reset_wanted(self) -> cython.bint:
        return self.store.get_int(self.FSM_RESET) == 1

    @cython.ccall
    def inner_foot_flips_up(self) -> cython.bint:
        return self.store.get_float(self.MCFI_ANKLE_RATE) < -self.store.get_float(self.P_H_PM_F_RATE)

    @cython.ccall
    def outer_foot_flips_up(self) -> cython.bint:
        return self.store.get_float(self.MCFO_RIGHT_ANKLE_RATE) < -self.store.get_float(self.P_H_PM_F_RATE)

    @cython.ccall
    def outer_leg_past_vertical(self) -> cython.bint:
        return self.store.get_float(self.E_LO_ANGLE) > 0.0

    @cython.ccall
    def inner_leg_past_vertical(self) -> cython.bint:
        return self.store.get_float(self.E_LI_ANGLE) > 0.0

    @cython.ccall
    def inner_struck(self) -> cython.bint:
        return self.store.get_int(self.E_SWING_LEG) == 0

    @cython.ccall
    def outer_struck(self) -> cython.bint:
        return self.store.get_int(self.E_SWING_LEG) == 1


READS = variables_of(LegMachine)
