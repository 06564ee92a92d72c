# cython: boundscheck=False, wraparound=False, cdivision=True
# (places in `saved` are all written out; what is divided by is a length above zero)
"""Ranger's body: four links, two elastic ankle drives, two feet on the floor. Equations: plant/EQUATIONS.md.

Coordinates never swap names: every angle belongs to a leg, outer or inner (EQUATIONS 1). All are positive
clockwise seen with the walking direction to the right, that is in the forward direction:

    foot_*   absolute angle of the foot, 0 with the sweet spot on the floor, positive rolled to the toe
    leg_*    absolute angle of the leg, 0 upright, positive leaning forward (hip ahead of the ankle)
    motor_*  angle of the ankle motor over its gear, relative to its leg; equal to foot - leg without cable stretch

Modes: held by the operator, single stance, double stance, flight, fallen. Forces are those of the floor on the
robot, along the (sloped) floor and normal to it.

The body's fields and geometry stand here. What happens to it, in the order in which one file imports the next:

    stance, air      one step of the equations of motion: on one or two feet; in flight or in the operator's hands
    impact           a foot meets the floor
    lift_off         a foot leaves it
    watch            what is noticed once per step: footholds, extremes, falls
    motion           `advance`: a step with the events inside it
    handling         what the operator does: place, hold, release
"""

import cython

from ranger_sim.plant.floor import Floor
from ranger_sim.plant.parameters import BodyParameters
from ranger_sim.plant.walk_record import WalkRecord

if not cython.compiled:
    from math import cos, sin, sqrt

OUTER = 0
INNER = 1

HELD = 0
SINGLE = 1
DOUBLE = 2
FLIGHT = 3
FALLEN = 4
MODE_NAMES = ("held", "single stance", "double stance", "flight", "fallen")


class Body:
    """State and motion of the mechanical robot. `parameters`: BodyParameters; `floor`: Floor."""

    def __init__(self, parameters=None, floor=None) -> None:
        p = parameters if parameters is not None else BodyParameters()
        self.parameters = p
        self.floor = floor if floor is not None else Floor(p.slope_rad)
        self.record = WalkRecord()
        self.terms = None  # additional joint torques of a model file, see EQUATIONS 12

        # state (rad, rad/s, m, m/s)
        self.foot_outer = 0.0
        self.leg_outer = 0.0
        self.leg_inner = 0.0
        self.foot_inner = 0.0
        self.motor_outer = 0.0
        self.motor_inner = 0.0
        self.foot_outer_rate = 0.0
        self.leg_outer_rate = 0.0
        self.leg_inner_rate = 0.0
        self.foot_inner_rate = 0.0
        self.motor_outer_rate = 0.0
        self.motor_inner_rate = 0.0
        self.hip_x = 0.0
        self.hip_y = 0.0
        self.hip_vx = 0.0
        self.hip_vy = 0.0
        self.saved = [0.0] * 16

        # sines and cosines of the four angles that are named here; `_know_angles` brings them up to date
        self.known_foot_outer = 0.0
        self.sin_foot_outer = 0.0
        self.cos_foot_outer = 1.0
        self.known_leg_outer = 0.0
        self.sin_leg_outer = 0.0
        self.cos_leg_outer = 1.0
        self.known_leg_inner = 0.0
        self.sin_leg_inner = 0.0
        self.cos_leg_inner = 1.0
        self.known_foot_inner = 0.0
        self.sin_foot_inner = 0.0
        self.cos_foot_inner = 1.0

        # contact: where the sweet spot of a standing foot would touch, and the height of its foothold
        self.mode = 0
        self.stance = 0  # leg that carries in single stance, reference leg in double stance
        self.anchor_outer = 0.0
        self.anchor_inner = 0.0
        self.height_outer = 0.0
        self.height_inner = 0.0
        self.gap_outer = 0.0
        self.gap_inner = 0.0
        self.outer_armed = False  # the foot has been clear of the floor since it left it
        self.inner_armed = False
        self.foothold_due = False  # the swing foot has not passed the stance foot yet
        self.last_strike_leg = -1
        self.lock_hip = False
        self.standing = False
        self.scuff_time_s = -1.0
        self.passing_gap = 1.0  # m, lowest clearance while the swing foot passes
        self.friction_ratio_max = 0.0  # worst |F_x| / F_y of the walk
        self.slip_s = 0.0  # s with more than the floor's friction asked for
        self.normal_force_min = 0.0  # N, worst pull that lift-off could not answer
        self.brush = False  # the swing foot is near the floor and not ahead: its sole may touch
        self.brushing = False
        self.brush_s = 0.0  # s with the swing foot's sole on the floor
        self.sole_k = p.sole_N_per_m
        self.sole_c = p.sole_Ns_per_m
        self.sole_v = 1.0 / p.sole_sliding_smoothing_m_s
        self.strike_ahead = p.strike_ahead_m
        self.pull_s = 0.0  # s with a pull of more than 1 N
        self.mu = p.floor_friction

        # forces of the floor at the start of the last step, N
        self.outer_Fx = 0.0
        self.outer_Fy = 0.0
        self.inner_Fx = 0.0
        self.inner_Fy = 0.0
        # accelerations at the start of the last step
        self.foot_outer_acc = 0.0
        self.leg_outer_acc = 0.0
        self.leg_inner_acc = 0.0
        self.foot_inner_acc = 0.0
        self.motor_outer_acc = 0.0
        self.motor_inner_acc = 0.0
        self.hip_ay = 0.0  # in the air only

        # torques of the motors during a step: drive - coulomb tanh(rate / epsilon) - viscous rate, at the joint
        self.hip_drive = 0.0
        self.hip_coulomb = 0.0
        self.hip_viscous = 0.0
        self.outer_drive = 0.0
        self.outer_coulomb = 0.0
        self.outer_viscous = 0.0
        self.inner_drive = 0.0
        self.inner_coulomb = 0.0
        self.inner_viscous = 0.0
        # additional torques of the terms, set by them: on h, and on the two ankles (joint side) and motors
        self.extra_hip = 0.0
        self.extra_outer = 0.0
        self.extra_inner = 0.0
        self.extra_outer_motor = 0.0
        self.extra_inner_motor = 0.0

        # parameters in the letters of EQUATIONS
        self.M = p.total_mass_kg
        self.mc_outer = p.outer_mass_moment_kg_m
        self.mc_inner = p.inner_mass_moment_kg_m
        self.mw_outer = p.outer_mass_offset_kg_m
        self.mw_inner = p.inner_mass_offset_kg_m
        self.J_outer = p.outer_hip_inertia_kg_m2
        self.J_inner = p.inner_hip_inertia_kg_m2
        self.Jf = p.foot_inertia_kg_m2
        self.JH = p.hip_rotor_inertia_kg_m2
        self.JA = p.ankle_rotor_inertia_kg_m2
        self.el = p.leg_length_m
        self.r = p.foot_radius_m
        self.d = p.ankle_offset_m
        self.kh = p.hip_spring_Nm_per_rad
        self.ks = p.ankle_spring_Nm_per_rad
        self.exact_spring = p.exact_hip_spring
        self.spring_ab = p.hip_spring_arm_a_m * p.hip_spring_arm_b_m
        self.spring_aabb = p.hip_spring_arm_a_m * p.hip_spring_arm_a_m + p.hip_spring_arm_b_m * p.hip_spring_arm_b_m
        self.spring_l0 = p.hip_spring_rest_length_m
        self.spring_k = p.hip_spring_rate_N_per_m if p.exact_hip_spring else 0.0
        self.gx = 0.0
        self.gy = 0.0
        self.set_slope(self.floor.slope_rad)
        # of these alone: of the mass matrix what is constant, with a leg as stance leg and (inverse) as the other one
        self.m22_outer = self.M * self.el * self.el - 2.0 * self.el * self.mc_outer + self.J_outer + self.JH
        self.m22_inner = self.M * self.el * self.el - 2.0 * self.el * self.mc_inner + self.J_inner + self.JH
        self.mt_outer = self.M * self.el - self.mc_outer
        self.mt_inner = self.M * self.el - self.mc_inner
        self.i33_outer = 1.0 / (self.J_outer + self.JH)
        self.i33_inner = 1.0 / (self.J_inner + self.JH)
        self.inverse_JA = 1.0 / self.JA
        self.inverse_Jf = 1.0 / self.Jf if self.Jf > 0.0 else 0.0
        self.C_outer = p.outer_rolling_friction_Nms
        self.C_inner = p.inner_rolling_friction_Nms
        self.heel = p.arc_heel_rad
        self.toe = p.arc_toe_rad
        self.stop_low = p.ankle_stop_low_rad - p.ankle_zero_rad
        self.stop_high = p.ankle_stop_high_rad - p.ankle_zero_rad
        self.stop_k = p.ankle_stop_Nm_per_rad
        self.stop_c = p.ankle_stop_Nms_per_rad
        self.inverse_smoothing = 1.0 / p.friction_smoothing_rad_s
        # Errors of the closed linkage in double stance decay at this rate (1/s). Chosen by us: it changes
        # accelerations only by rate^2 x error, 1e-8 m/s^2 at an error of 1e-12 m, and keeps an endless stand closed.
        self.closing_rate = 100.0
        self.fall_lean = 0.6  # rad; see EQUATIONS 16 for the fall rules
        self.fall_height = 0.65  # of the leg length
        self.fall_split = 1.2  # rad between the legs
        self.stall_s = 3.0
        self.cause = ""

        self.time_s = 0.0  # since the body was made; only for durations
        self.released_s = 0.0
        self.elapsed = 0.0  # s since the start of the running step
        self.step_start_ns = 0
        self.event = 0
        self.changes = 0  # touches, lift-offs and falls so far
        self.unilateral = False  # the trailing foot may leave at a heel-strike (EQUATIONS 8)
        self.lift_leading = True  # the leading foot may leave in double stance
        self.P_stance_x = 0.0  # impulses of the last impact, N s
        self.P_stance_y = 0.0
        self.P_swing_x = 0.0
        self.P_swing_y = 0.0
        self.matrix = [0.0] * 110
        self.solution = [0.0] * 10
        # in the operator's hands, upright, the inner legs ahead
        self.leg_inner = -0.3
        self.foot_inner = -0.3
        self.lift()
        self.update_pose()

    # ---- where things are -----------------------------------------------------------------------------------

    def set_slope(self, slope_rad: cython.double) -> cython.void:
        """Turn gravity: the floor falls in the walking direction by `slope_rad` (EQUATIONS 3)."""
        g: cython.double = self.parameters.gravity_m_per_s2
        self.gx = g * sin(slope_rad)
        self.gy = -g * cos(slope_rad)

    def excess(self, foot: cython.double) -> cython.double:
        """Angle by which a foot has rolled beyond the end of its arc (sigma), 0 on the arc."""
        if foot < self.heel:
            return foot - self.heel
        if foot > self.toe:
            return foot - self.toe
        return 0.0

    def chain_x(self, foot: cython.double, leg: cython.double) -> cython.double:
        """Hip ahead of the anchor of a standing foot, m (EQUATIONS 4)."""
        excess: cython.double = self.excess(foot)
        return self.r * (foot - excess + sin(excess)) - self.d * sin(foot) + self.el * sin(leg)

    def chain_y(self, foot: cython.double, leg: cython.double) -> cython.double:
        """Hip above the foothold of a standing foot, m (EQUATIONS 4)."""
        return self.r * cos(self.excess(foot)) - self.d * cos(foot) + self.el * cos(leg)

    def know_angles(self) -> cython.void:
        """Sines and cosines of the present angles into the fields; the steps on the floor leave them there."""
        if self.foot_outer != self.known_foot_outer:
            self.known_foot_outer = self.foot_outer
            self.sin_foot_outer = sin(self.foot_outer)
            self.cos_foot_outer = cos(self.foot_outer)
        if self.leg_outer != self.known_leg_outer:
            self.known_leg_outer = self.leg_outer
            self.sin_leg_outer = sin(self.leg_outer)
            self.cos_leg_outer = cos(self.leg_outer)
        if self.leg_inner != self.known_leg_inner:
            self.known_leg_inner = self.leg_inner
            self.sin_leg_inner = sin(self.leg_inner)
            self.cos_leg_inner = cos(self.leg_inner)
        if self.foot_inner != self.known_foot_inner:
            self.known_foot_inner = self.foot_inner
            self.sin_foot_inner = sin(self.foot_inner)
            self.cos_foot_inner = cos(self.foot_inner)

    def behind(self, leg: cython.longlong) -> cython.double:
        """The lowest point of a foot behind the hip, m (EQUATIONS 4)."""
        foot: cython.double
        x: cython.double
        self.know_angles()
        if leg == 0:
            foot = self.foot_outer
            x = self.el * self.sin_leg_outer - self.d * self.sin_foot_outer
        else:
            foot = self.foot_inner
            x = self.el * self.sin_leg_inner - self.d * self.sin_foot_inner
        if foot < self.heel or foot > self.toe:
            x += self.r * sin(self.excess(foot))
        return x

    def ahead(self) -> cython.double:
        """How far the swing foot's lowest point is ahead of the stance foot's, m."""
        if self.stance == 0:
            return self.behind(0) - self.behind(1)
        return self.behind(1) - self.behind(0)

    def anchor(self, leg: cython.longlong) -> cython.void:
        """From here on the foot stands where it is."""
        if leg == 0:
            self.anchor_outer = self.hip_x - self.chain_x(self.foot_outer, self.leg_outer)
        else:
            self.anchor_inner = self.hip_x - self.chain_x(self.foot_inner, self.leg_inner)

    def contact_x(self, leg: cython.longlong) -> cython.double:
        """Where the lowest point of a foot is along the floor, m."""
        return self.hip_x - self.behind(leg)

    def ankle_x(self, leg: cython.longlong) -> cython.double:
        """Where an ankle is along the floor, m."""
        return self.hip_x - self.el * sin(self.leg_outer if leg == 0 else self.leg_inner)

    def update_pose(self) -> cython.void:
        """Hip position and the two gaps from the angles (in flight and held: the gaps only)."""
        el: cython.double = self.el
        d: cython.double = self.d
        r: cython.double = self.r
        outer: cython.double
        inner: cython.double
        foot: cython.double
        self.know_angles()
        # the hip above its anchors, and ahead of that of the reference leg: EQUATIONS 4
        outer = el * self.cos_leg_outer - d * self.cos_foot_outer
        foot = self.foot_outer
        outer += r * cos(self.excess(foot)) if foot < self.heel or foot > self.toe else r
        inner = el * self.cos_leg_inner - d * self.cos_foot_inner
        foot = self.foot_inner
        inner += r * cos(self.excess(foot)) if foot < self.heel or foot > self.toe else r
        if self.mode == 1 or self.mode == 2 or self.standing:
            if self.stance == 0:
                foot = self.foot_outer
                self.hip_y = self.height_outer + outer
                self.hip_x = self.anchor_outer + el * self.sin_leg_outer - d * self.sin_foot_outer + r * foot
            else:
                self.hip_y = self.height_inner + inner
                self.hip_x = self.anchor_inner + el * self.sin_leg_inner - d * self.sin_foot_inner + r * foot
            if foot < self.heel or foot > self.toe:
                self.hip_x += r * (sin(self.excess(foot)) - self.excess(foot))
        self.gap_outer = self.hip_y - outer - self.height_outer
        self.gap_inner = self.hip_y - inner - self.height_inner

    def update_hip_rates(self) -> cython.void:
        """Hip velocity from the standing foot (EQUATIONS 4)."""
        foot: cython.double
        foot_rate: cython.double
        leg_rate: cython.double
        excess: cython.double
        if self.mode != 1 and self.mode != 2:
            return
        self.know_angles()
        if self.stance == 0:
            foot, foot_rate, leg_rate = self.foot_outer, self.foot_outer_rate, self.leg_outer_rate
            sF, cF, st, ct = self.sin_foot_outer, self.cos_foot_outer, self.sin_leg_outer, self.cos_leg_outer
        else:
            foot, foot_rate, leg_rate = self.foot_inner, self.foot_inner_rate, self.leg_inner_rate
            sF, cF, st, ct = self.sin_foot_inner, self.cos_foot_inner, self.sin_leg_inner, self.cos_leg_inner
        excess = self.excess(foot)
        self.hip_vx = (self.r * cos(excess) - self.d * cF) * foot_rate + self.el * ct * leg_rate
        self.hip_vy = (self.d * sF - self.r * sin(excess)) * foot_rate - self.el * st * leg_rate

    def hip_angle(self) -> cython.double:
        """h of the firmware: inner legs ahead of the outer ones, rad."""
        return self.leg_outer - self.leg_inner

    def hip_rate(self) -> cython.double:
        return self.leg_outer_rate - self.leg_inner_rate

    def stands(self, leg: cython.longlong) -> cython.bint:
        """True while this foot has the floor under it."""
        if self.mode == 2:
            return True
        if self.mode == 1 or self.standing:
            if leg == self.stance:
                return True
            return (self.outer_Fy if leg == 0 else self.inner_Fy) > 0.0
        return False

    def snapshot(self) -> dict:
        """Points in the plane of the floor for a drawing, m: hip, ankles, foot centres; angles in rad."""
        joints = {"hip": (self.hip_x, self.hip_y), "mode": MODE_NAMES[self.mode], "stance": int(self.stance)}
        for name, leg, foot in (
            ("outer", self.leg_outer, self.foot_outer),
            ("inner", self.leg_inner, self.foot_inner),
        ):
            ankle = (self.hip_x - self.el * sin(leg), self.hip_y - self.el * cos(leg))
            joints[name] = {
                "ankle": ankle,
                "foot_centre": (ankle[0] + self.d * sin(foot), ankle[1] + self.d * cos(foot)),
                "leg_rad": leg,
                "foot_rad": foot,
            }
        return joints

    # ---- joints ---------------------------------------------------------------------------------------------

    def stop_torque(self, angle: cython.double, rate: cython.double) -> cython.double:
        """Torque of an ankle stop on the foot: a spring and damper that can only push (EQUATIONS 2.5)."""
        torque: cython.double
        if angle < self.stop_low:
            torque = self.stop_k * (self.stop_low - angle) - self.stop_c * rate
            return torque if torque > 0.0 else 0.0
        torque = self.stop_k * (self.stop_high - angle) - self.stop_c * rate
        return torque if torque < 0.0 else 0.0

    def spring_torque(self, angle: cython.double) -> cython.double:
        """Torque of the hip spring by its geometry (EQUATIONS 2.4)."""
        length: cython.double = sqrt(self.spring_aabb - 2.0 * self.spring_ab * cos(angle))
        return 2.0 * self.spring_k * self.spring_ab * (1.0 - self.spring_l0 / length) * sin(angle)

    def ask_terms(
        self,
        outer_stance: cython.bint,
        hip: cython.double,
        a_s: cython.double,
        a_w: cython.double,
        p: cython.double,
        n: cython.double,
        hip_rate: cython.double,
        ra_s: cython.double,
        ra_w: cython.double,
        up: cython.double,
        un: cython.double,
    ) -> None:
        """Let the additional terms set their torques for this state, in fixed legs (EQUATIONS 12)."""
        if outer_stance:
            self.terms.joint_torques(self, hip, hip_rate, a_s, ra_s, a_w, ra_w, p, up, n, un)
        else:
            self.terms.joint_torques(self, -hip, -hip_rate, a_w, ra_w, a_s, ra_s, n, un, p, up)

    def limp_foot(self, leg: cython.longlong) -> cython.void:
        """A massless foot in the air stands where its motor holds it, q4 = q4m (EQUATIONS 7)."""
        if leg == 0:
            self.foot_outer = self.leg_outer + self.motor_outer
            self.foot_outer_rate = self.leg_outer_rate + self.motor_outer_rate
        else:
            self.foot_inner = self.leg_inner + self.motor_inner
            self.foot_inner_rate = self.leg_inner_rate + self.motor_inner_rate

    # ---- the whole state ------------------------------------------------------------------------------------

    def lift(self) -> cython.void:
        """Raise the hip 50 mm higher than standing (chosen by us: feet turn free of the floor)."""
        self.hip_y = self.el + self.r - self.d + 0.05

    def energy_J(self) -> cython.double:
        """Kinetic and potential energy with springs and rotors, potential measured from the floor's frame."""
        Ao: cython.double = self.mc_outer * cos(self.leg_outer) + self.mw_outer * sin(self.leg_outer)
        Bo: cython.double = self.mc_outer * sin(self.leg_outer) - self.mw_outer * cos(self.leg_outer)
        Ai: cython.double = self.mc_inner * cos(self.leg_inner) + self.mw_inner * sin(self.leg_inner)
        Bi: cython.double = self.mc_inner * sin(self.leg_inner) - self.mw_inner * cos(self.leg_inner)
        uo: cython.double = self.leg_outer_rate
        ui: cython.double = self.leg_inner_rate
        h: cython.double = self.leg_outer - self.leg_inner
        so: cython.double = self.motor_outer - (self.foot_outer - self.leg_outer)
        si: cython.double = self.motor_inner - (self.foot_inner - self.leg_inner)
        spring: cython.double
        length: cython.double
        self.update_pose()
        self.update_hip_rates()
        if self.exact_spring:
            length = sqrt(self.spring_aabb - 2.0 * self.spring_ab * cos(h))
            spring = self.spring_k * (length - self.spring_l0) * (length - self.spring_l0)
        else:
            spring = 0.5 * self.kh * h * h
        return (
            0.5 * self.M * (self.hip_vx * self.hip_vx + self.hip_vy * self.hip_vy)
            - self.hip_vx * (Ao * uo + Ai * ui)
            + self.hip_vy * (Bo * uo + Bi * ui)
            + 0.5 * (self.J_outer * uo * uo + self.J_inner * ui * ui)
            + 0.5 * self.Jf * self.foot_outer_rate * self.foot_outer_rate
            + 0.5 * self.Jf * self.foot_inner_rate * self.foot_inner_rate
            + 0.5 * self.JH * (uo - ui) * (uo - ui)
            + 0.5 * self.JA * self.motor_outer_rate * self.motor_outer_rate
            + 0.5 * self.JA * self.motor_inner_rate * self.motor_inner_rate
            + 0.5 * self.ks * (so * so + si * si)
            + spring
            - self.gx * (self.M * self.hip_x - Bo - Bi)
            - self.gy * (self.M * self.hip_y - Ao - Ai)
        )

    def event_time_ns(self) -> cython.longlong:
        """Instant of the running event, ns."""
        return self.step_start_ns + int(self.elapsed * 1e9 + 0.5)

    def save(self) -> cython.void:
        s: cython.p_double = self.saved
        s[0] = self.foot_outer
        s[1] = self.leg_outer
        s[2] = self.leg_inner
        s[3] = self.foot_inner
        s[4] = self.motor_outer
        s[5] = self.motor_inner
        s[6] = self.foot_outer_rate
        s[7] = self.leg_outer_rate
        s[8] = self.leg_inner_rate
        s[9] = self.foot_inner_rate
        s[10] = self.motor_outer_rate
        s[11] = self.motor_inner_rate
        s[12] = self.hip_x
        s[13] = self.hip_y
        s[14] = self.hip_vx
        s[15] = self.hip_vy

    def restore(self) -> cython.void:
        s: cython.p_double = self.saved
        self.foot_outer = s[0]
        self.leg_outer = s[1]
        self.leg_inner = s[2]
        self.foot_inner = s[3]
        self.motor_outer = s[4]
        self.motor_inner = s[5]
        self.foot_outer_rate = s[6]
        self.leg_outer_rate = s[7]
        self.leg_inner_rate = s[8]
        self.foot_inner_rate = s[9]
        self.motor_outer_rate = s[10]
        self.motor_inner_rate = s[11]
        self.hip_x = s[12]
        self.hip_y = s[13]
        self.hip_vx = s[14]
        self.hip_vy = s[15]
