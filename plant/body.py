# cython: boundscheck=False, wraparound=False, cdivision=True
# (indices are those of `saved`, `matrix` and `solution`, all written out; no integer is divided)
"""Ranger's body: four links, two elastic ankle drives, two feet on the floor. Equations: plant/EQUATIONS.md.

Coordinates never swap names: every angle belongs to a leg, outer or inner (EQUATIONS 1). All are positive
clockwise seen with the walking direction to the right, that is in the forward direction:

    foot_*   absolute angle of the foot, 0 with the sweet spot on the floor, positive rolled to the toe
    leg_*    absolute angle of the leg, 0 upright, positive leaning forward (hip ahead of the ankle)
    motor_*  angle of the ankle motor over its gear, relative to its leg; equal to foot - leg without cable stretch

Modes: held by the operator, single stance, double stance, flight, fallen. Forces are those of the floor on the
robot, along the (sloped) floor and normal to it.
"""

import cython

from plant.floor import Floor
from plant.parameters import BodyParameters
from plant.walk_record import WalkRecord

if not cython.compiled:
    from math import cos, fabs, sin, sqrt

    from plant.friction import smoothed_sign

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
        self.place(0.0, 0.3)

    def set_slope(self, slope_rad: cython.double) -> cython.void:
        """Turn gravity: the floor falls in the walking direction by `slope_rad` (EQUATIONS 3)."""
        g: cython.double = self.parameters.gravity_m_per_s2
        self.gx = g * sin(slope_rad)
        self.gy = -g * cos(slope_rad)

    # ---- where things are -------------------------------------------------------------------------------------

    def chain_x(self, foot: cython.double, leg: cython.double) -> cython.double:
        """Hip ahead of the anchor of a standing foot, m (EQUATIONS 4)."""
        excess: cython.double = self._excess(foot)
        return self.r * (foot - excess + sin(excess)) - self.d * sin(foot) + self.el * sin(leg)

    def chain_y(self, foot: cython.double, leg: cython.double) -> cython.double:
        """Hip above the foothold of a standing foot, m (EQUATIONS 4)."""
        return self.r * cos(self._excess(foot)) - self.d * cos(foot) + self.el * cos(leg)

    def _excess(self, foot: cython.double) -> cython.double:
        """Angle by which a foot has rolled beyond the end of its arc (sigma), 0 on the arc."""
        if foot < self.heel:
            return foot - self.heel
        if foot > self.toe:
            return foot - self.toe
        return 0.0

    def _know_angles(self) -> cython.void:
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

    def _behind(self, leg: cython.longlong) -> cython.double:
        """The lowest point of a foot behind the hip, m (EQUATIONS 4)."""
        foot: cython.double
        x: cython.double
        self._know_angles()
        if leg == 0:
            foot = self.foot_outer
            x = self.el * self.sin_leg_outer - self.d * self.sin_foot_outer
        else:
            foot = self.foot_inner
            x = self.el * self.sin_leg_inner - self.d * self.sin_foot_inner
        if foot < self.heel or foot > self.toe:
            x += self.r * sin(self._excess(foot))
        return x

    def contact_x(self, leg: cython.longlong) -> cython.double:
        """Where the lowest point of a foot is along the floor, m."""
        return self.hip_x - self._behind(leg)

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
        self._know_angles()
        # the hip above its anchors, and ahead of that of the reference leg: EQUATIONS 4
        outer = el * self.cos_leg_outer - d * self.cos_foot_outer
        foot = self.foot_outer
        outer += r * cos(self._excess(foot)) if foot < self.heel or foot > self.toe else r
        inner = el * self.cos_leg_inner - d * self.cos_foot_inner
        foot = self.foot_inner
        inner += r * cos(self._excess(foot)) if foot < self.heel or foot > self.toe else r
        if self.mode == 1 or self.mode == 2 or self.standing:
            if self.stance == 0:
                foot = self.foot_outer
                self.hip_y = self.height_outer + outer
                self.hip_x = self.anchor_outer + el * self.sin_leg_outer - d * self.sin_foot_outer + r * foot
            else:
                self.hip_y = self.height_inner + inner
                self.hip_x = self.anchor_inner + el * self.sin_leg_inner - d * self.sin_foot_inner + r * foot
            if foot < self.heel or foot > self.toe:
                self.hip_x += r * (sin(self._excess(foot)) - self._excess(foot))
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
        self._know_angles()
        if self.stance == 0:
            foot, foot_rate, leg_rate = self.foot_outer, self.foot_outer_rate, self.leg_outer_rate
            sF, cF, st, ct = self.sin_foot_outer, self.cos_foot_outer, self.sin_leg_outer, self.cos_leg_outer
        else:
            foot, foot_rate, leg_rate = self.foot_inner, self.foot_inner_rate, self.leg_inner_rate
            sF, cF, st, ct = self.sin_foot_inner, self.cos_foot_inner, self.sin_leg_inner, self.cos_leg_inner
        excess = self._excess(foot)
        self.hip_vx = (self.r * cos(excess) - self.d * cF) * foot_rate + self.el * ct * leg_rate
        self.hip_vy = (self.d * sF - self.r * sin(excess)) * foot_rate - self.el * st * leg_rate

    def stands(self, leg: cython.longlong) -> cython.bint:
        """True while this foot has the floor under it."""
        if self.mode == 2:
            return True
        if self.mode == 1 or self.standing:
            if leg == self.stance:
                return True
            return (self.outer_Fy if leg == 0 else self.inner_Fy) > 0.0
        return False

    def hip_angle(self) -> cython.double:
        """h of the firmware: inner legs ahead of the outer ones, rad."""
        return self.leg_outer - self.leg_inner

    def hip_rate(self) -> cython.double:
        return self.leg_outer_rate - self.leg_inner_rate

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

    # ---- what the operator does -------------------------------------------------------------------------------

    def place(self, outer_leg_rad: cython.double, hip_rad: cython.double) -> cython.void:
        """Everything at rest in the operator's hands, feet square to their legs, the hip free."""
        self.leg_outer = outer_leg_rad
        self.leg_inner = outer_leg_rad - hip_rad
        self.foot_outer = self.leg_outer
        self.foot_inner = self.leg_inner
        self.motor_outer = 0.0
        self.motor_inner = 0.0
        self.foot_outer_rate = 0.0
        self.foot_inner_rate = 0.0
        self.leg_inner_rate = 0.0
        self.motor_outer_rate = 0.0
        self.motor_inner_rate = 0.0
        self.hold(outer_leg_rad)

    def hold(self, outer_leg_rad: cython.double) -> cython.void:
        """Lift the robot by its outer legs, which the operator keeps at this lean, motionless.

        The inner leg hangs at the hip and both feet hang free, so the motors move them; the hip is 50 mm higher
        than standing (chosen by us: feet turn free of the floor).
        """
        self.mode = 0
        self.stance = 0
        self.leg_outer = outer_leg_rad
        self.leg_outer_rate = 0.0
        self.hip_vx = 0.0
        self.hip_vy = 0.0
        self.hip_y = self.el + self.r - self.d + 0.05
        self.outer_Fx = 0.0
        self.outer_Fy = 0.0
        self.inner_Fx = 0.0
        self.inner_Fy = 0.0
        self.lock_hip = False
        self.standing = False
        self.cause = ""
        self.last_strike_leg = -1
        if self.Jf == 0.0:
            self.limp_foot(0)
            self.limp_foot(1)
        self.update_pose()

    def hold_both(self, outer_leg_rad: cython.double, hip_rad: cython.double) -> cython.void:
        """As `hold`, and the operator keeps the inner legs at this hip angle too."""
        self.leg_inner = outer_leg_rad - hip_rad
        self.leg_inner_rate = 0.0
        self.hold(outer_leg_rad)
        self.lock_hip = True

    def hold_standing(
        self, outer_leg_rad: cython.double, hip_rad: cython.double, stance: cython.longlong = 0
    ) -> cython.void:
        """As `hold_both`, with the stance foot on the floor under the robot's weight, where it may roll.

        The hands guide the legs' angles only. They also damp the rolling; 2 N m s/rad, about critical for the
        0.08 kg m^2 that roll against the cable: chosen by us, so that a posture settles at once.
        """
        self.hold_both(outer_leg_rad, hip_rad)
        self.standing = True
        self.stance = stance
        self.height_outer = 0.0
        self.height_inner = 0.0
        if stance == 0:
            self.anchor_outer = self.hip_x - self.chain_x(self.foot_outer, self.leg_outer)
        else:
            self.anchor_inner = self.hip_x - self.chain_x(self.foot_inner, self.leg_inner)
        self.update_pose()

    def release(
        self,
        outer_leg_rate: cython.double,
        stance: cython.longlong = 0,
        stance_foot_rate: cython.double = 0.0,
        hip_rate: cython.double = 0.0,
    ) -> cython.void:
        """Set the stance foot on the floor as it is and let go, with these rates (rad/s).

        hip_rate: of h, inner legs forward. When the other foot would stand in the floor the walk ends at once
        with that as its cause.
        """
        self.mode = 1
        self.stance = stance
        self.leg_outer_rate = outer_leg_rate
        self.leg_inner_rate = outer_leg_rate - hip_rate
        if stance == 0:
            self.foot_outer_rate = stance_foot_rate
        else:
            self.foot_inner_rate = stance_foot_rate
        self.begin_walk()

    def begin_walk(self) -> cython.void:
        """Stand on the stance foot from here on: anchors, footholds and the record start anew."""
        first: cython.double = self.floor.first_height()
        self.mode = 1
        self.standing = False
        self.height_outer = first
        self.height_inner = first
        self.foothold_due = True
        self.last_strike_leg = self.stance
        self.anchor_outer = 0.0
        self.anchor_inner = 0.0
        if self.stance == 0:
            self.anchor_outer = self.hip_x - self.chain_x(self.foot_outer, self.leg_outer)
        else:
            self.anchor_inner = self.hip_x - self.chain_x(self.foot_inner, self.leg_inner)
        if self.Jf == 0.0:
            self.limp_foot(1 - self.stance)
        self.update_pose()
        self.update_hip_rates()
        self.outer_armed = self.gap_outer > 1e-6
        self.inner_armed = self.gap_inner > 1e-6
        self.released_s = self.time_s
        self.scuff_time_s = -1.0
        self.passing_gap = 1.0
        self.friction_ratio_max = 0.0
        self.slip_s = 0.0
        self.normal_force_min = 0.0
        self.pull_s = 0.0
        self.brush = False
        self.brushing = False
        self.brush_s = 0.0
        self.cause = ""
        self.record.begin(self.step_start_ns, self.contact_x(self.stance))
        self.changes += 1
        if (self.gap_inner if self.stance == 0 else self.gap_outer) < 0.0:
            self._fall("put down with the swing foot in the floor")

    def limp_foot(self, leg: cython.longlong) -> cython.void:
        """A massless foot in the air stands where its motor holds it, q4 = q4m (EQUATIONS 7)."""
        if leg == 0:
            self.foot_outer = self.leg_outer + self.motor_outer
            self.foot_outer_rate = self.leg_outer_rate + self.motor_outer_rate
        else:
            self.foot_inner = self.leg_inner + self.motor_inner
            self.foot_inner_rate = self.leg_inner_rate + self.motor_inner_rate

    # ---- motion on one or two feet ----------------------------------------------------------------------------

    def on_feet(self, h: cython.double, stages: cython.longlong) -> cython.void:
        """One Runge-Kutta-Nystrom step of `h` seconds in single or double stance; stages 4, or 1 to look only.

        Inside, s is the stance (reference) leg and w the other. Accelerations and floor forces of the start of
        the step are left in the fields (EQUATIONS 5, 6); the stages' angles and rates are those of EQUATIONS 15.
        The pose of the end, hip and gaps, is left there too.
        """
        double_stance: cython.bint = self.mode == 2
        outer_stance: cython.bint = self.stance == 0
        massless: cython.bint = self.Jf == 0.0 and not double_stance
        brush: cython.bint = self.brush and not double_stance
        with_terms: cython.bint = self.terms is not None
        exact_spring: cython.bint = self.exact_spring
        stage: cython.longlong
        M: cython.double = self.M
        el: cython.double = self.el
        r: cython.double = self.r
        d: cython.double = self.d
        gx: cython.double = self.gx
        gy: cython.double = self.gy
        kh: cython.double = self.kh
        ks: cython.double = self.ks
        Jf: cython.double = self.Jf
        JH: cython.double = self.JH
        iJA: cython.double = self.inverse_JA
        iJf: cython.double = self.inverse_Jf
        heel: cython.double = self.heel
        toe: cython.double = self.toe
        low: cython.double = self.stop_low
        high: cython.double = self.stop_high
        eps: cython.double = self.inverse_smoothing
        hip_coulomb: cython.double = self.hip_coulomb
        hip_viscous: cython.double = self.hip_viscous
        self._know_angles()
        if outer_stance:
            F0, th0, tw0, G0 = self.foot_outer, self.leg_outer, self.leg_inner, self.foot_inner
            p0, n0 = self.motor_outer, self.motor_inner
            uF0, us0, uw0, uG0 = (
                self.foot_outer_rate,
                self.leg_outer_rate,
                self.leg_inner_rate,
                self.foot_inner_rate,
            )
            up0, un0 = self.motor_outer_rate, self.motor_inner_rate
            sF, cF, st, ct = self.sin_foot_outer, self.cos_foot_outer, self.sin_leg_outer, self.cos_leg_outer
            sw, cw, sG, cG = self.sin_leg_inner, self.cos_leg_inner, self.sin_foot_inner, self.cos_foot_inner
            mts, mws, mcw, mww = self.mt_outer, self.mw_outer, self.mc_inner, self.mw_inner
            m22, i33, Cs, Cw = self.m22_outer, self.i33_inner, self.C_outer, self.C_inner
            hip_drive = self.hip_drive
            s_drive, s_coulomb, s_viscous = self.outer_drive, self.outer_coulomb, self.outer_viscous
            w_drive, w_coulomb, w_viscous = self.inner_drive, self.inner_coulomb, self.inner_viscous
            Xs, Xw, Ys, Yw = self.anchor_outer, self.anchor_inner, self.height_outer, self.height_inner
        else:
            F0, th0, tw0, G0 = self.foot_inner, self.leg_inner, self.leg_outer, self.foot_outer
            p0, n0 = self.motor_inner, self.motor_outer
            uF0, us0, uw0, uG0 = (
                self.foot_inner_rate,
                self.leg_inner_rate,
                self.leg_outer_rate,
                self.foot_outer_rate,
            )
            up0, un0 = self.motor_inner_rate, self.motor_outer_rate
            sF, cF, st, ct = self.sin_foot_inner, self.cos_foot_inner, self.sin_leg_inner, self.cos_leg_inner
            sw, cw, sG, cG = self.sin_leg_outer, self.cos_leg_outer, self.sin_foot_outer, self.cos_foot_outer
            mts, mws, mcw, mww = self.mt_inner, self.mw_inner, self.mc_outer, self.mw_outer
            m22, i33, Cs, Cw = self.m22_inner, self.i33_outer, self.C_inner, self.C_outer
            hip_drive = -self.hip_drive
            s_drive, s_coulomb, s_viscous = self.inner_drive, self.inner_coulomb, self.inner_viscous
            w_drive, w_coulomb, w_viscous = self.outer_drive, self.outer_coulomb, self.outer_viscous
            Xs, Xw, Ys, Yw = self.anchor_inner, self.anchor_outer, self.height_inner, self.height_outer
        half: cython.double = 0.5 * h
        quarter: cython.double = 0.25 * h
        sixth: cython.double = h / 6.0
        F: cython.double = F0
        th: cython.double = th0
        tw: cython.double = tw0
        G: cython.double = G0
        p: cython.double = p0
        n: cython.double = n0
        a_s: cython.double = F - th
        a_w: cython.double = G - tw
        hip: cython.double = th - tw
        uF: cython.double = uF0
        us: cython.double = us0
        uw: cython.double = uw0
        uG: cython.double = uG0
        up: cython.double = up0
        un: cython.double = un0
        for stage in range(stages):
            # torques of the motors, first: they are calls, and before a call everything in registers is put aside
            hd = us - uw
            mp = s_drive - s_coulomb * smoothed_sign(up * eps) - s_viscous * up
            mn = w_drive - w_coulomb * smoothed_sign(un * eps) - w_viscous * un
            Th = hip_drive - hip_coulomb * smoothed_sign(hd * eps) - hip_viscous * hd
            if stage != 2:
                # what depends on angles alone; stages 1 and 2 look at the same ones
                if stage > 0:
                    sF = sin(F)
                    cF = cos(F)
                    st = sin(th)
                    ct = cos(th)
                    sw = sin(tw)
                    cw = cos(tw)
                    if stage == 3 or double_stance or brush:
                        sG = sin(G)
                        cG = cos(G)
                ls = el * st
                lc = el * ct
                Us = mts * ct - mws * st
                Vs = mts * st + mws * ct
                Aw = mcw * cw + mww * sw
                Bw = mcw * sw - mww * cw
                df = d * cF
                f = d * sF
                sg = 0.0
                e = r - df
                if F < heel or F > toe:
                    sg = F - heel if F < heel else F - toe
                    e = r * cos(sg) - df
                    f -= r * sin(sg)
                    df = -e
                m11 = M * (e * e + f * f) + Jf
                m12 = Us * e - Vs * f
                m13 = Bw * f - Aw * e
                m23 = -(lc * Aw + ls * Bw) - JH
                swing = ls * Aw - lc * Bw
                t13 = m13 * i33
                t23 = m23 * i33
                n11 = m11 - t13 * m13
                n12 = m12 - t13 * m23
                n22 = m22 - t23 * m23
                inv = 1.0 / (n11 * n22 - n12 * n12)
                n11 *= inv
                n12 *= inv
                n22 *= inv
                pull_s = ks * (p - a_s)
                pull_w = 0.0 if massless else ks * (n - a_w)
                spring = self._exact_spring(hip) if exact_spring else kh * hip
                if brush or double_stance or stage == 3:
                    dfw = d * cG
                    fw = d * sG
                    gg = 0.0
                    ew = r - dfw
                    if G < heel or G > toe:
                        gg = G - heel if G < heel else G - toe
                        ew = r * cos(gg) - dfw
                        fw -= r * sin(gg)
                        dfw = -ew
                    lsw = el * sw
                    lcw = el * cw
                    gap = (Ys - Yw) + (e - ew) + (lc - lcw)
                if double_stance:
                    # columns: what a unit force on the other foot does to the three accelerations (EQUATIONS 6)
                    b1 = e + t13 * lcw
                    b2 = lc + t23 * lcw
                    x1 = n22 * b1 - n12 * b2
                    x2 = n11 * b2 - n12 * b1
                    x3 = -i33 * lcw - t13 * x1 - t23 * x2
                    b1 = f - t13 * lsw
                    b2 = -ls - t23 * lsw
                    y1 = n22 * b1 - n12 * b2
                    y2 = n11 * b2 - n12 * b1
                    y3 = i33 * lsw - t13 * y1 - t23 * y2
                    Sxx = e * x1 + lc * x2 - lcw * x3
                    Sxy = e * y1 + lc * y2 - lcw * y3
                    Syy = f * y1 - ls * y2 + lsw * y3
                    c11 = -Syy * Jf - fw * fw
                    c12 = ew * fw + Sxy * Jf
                    c13 = ew * Syy - Sxy * fw
                    c22 = -Sxx * Jf - ew * ew
                    c23 = Sxx * fw - Sxy * ew
                    c33 = Sxx * Syy - Sxy * Sxy
                    idet = 1.0 / (Sxx * c11 + Sxy * c12 - ew * c13)
                    # r (F - sg) - f + l sin th, both legs
                    gap_x = (Xs - Xw) + r * ((F - sg) - (G - gg)) - (f - fw) + (ls - lsw)
            us2 = us * us
            uw2 = uw * uw
            uF2 = uF * uF
            # acceleration of the stance ankle without angular accelerations, less gravity (EQUATIONS 5.2)
            ax = f * uF2 - gx
            ay = df * uF2 - gy
            Px = M * ax - Vs * us2 + Bw * uw2
            Py = M * ay - Us * us2 + Aw * uw2
            # torques: cables with the motors behind them, stops, hip
            Ts = pull_s
            Tw = pull_w
            mp -= Ts
            mn -= Tw
            Th -= spring
            if a_s < low or a_s > high:
                Ts += self._stop(a_s, uF - us)
            if a_w < low or a_w > high:
                stop = self._stop(a_w, uG - uw)
                Tw += stop
                if massless:
                    mn += stop
            TF = Ts - Cs * uF
            TG = Tw
            if with_terms:
                self._ask_terms(outer_stance, hip, a_s, a_w, p, n, hd, uF - us, uG - uw, up, un)
                if outer_stance:
                    Th += self.extra_hip
                    Ts += self.extra_outer
                    TF += self.extra_outer
                    mp += self.extra_outer_motor
                    Tw += self.extra_inner
                    TG += self.extra_inner
                    mn += self.extra_inner_motor
                    if massless:
                        mn += self.extra_inner
                else:
                    Th -= self.extra_hip
                    Ts += self.extra_inner
                    TF += self.extra_inner
                    mp += self.extra_inner_motor
                    Tw += self.extra_outer
                    TG += self.extra_outer
                    mn += self.extra_outer_motor
                    if massless:
                        mn += self.extra_outer
            # generalised forces (EQUATIONS 5.3), unknowns: foot s, leg s, leg w
            Q1 = TF - e * Px - f * Py
            Q2 = Th - Ts - Us * ax + Vs * ay + swing * uw2
            Q3 = Aw * ax - Bw * ay - swing * us2 - Th - Tw
            Rx = 0.0
            Ry = 0.0
            if brush and gap < 0.0:
                # the swing foot brushes the floor with its sole: normal force and sliding friction (EQUATIONS 9)
                Ry = -self.sole_k * gap - self.sole_c * (f * uF - ls * us - fw * uG + lsw * uw)
                if Ry > 0.0:
                    Rx = -self.mu * Ry * smoothed_sign((e * uF + lc * us - ew * uG - lcw * uw) * self.sole_v)
                    push = -ew * Rx - fw * Ry
                    Q1 += e * Rx + f * Ry
                    Q2 += lc * Rx - ls * Ry
                    Q3 += lsw * Ry - lcw * Rx
                    TG += push
                    if massless:
                        Q3 += push
                        mn += push
                else:
                    Ry = 0.0
            b1 = Q1 - t13 * Q3
            b2 = Q2 - t23 * Q3
            aF = n22 * b1 - n12 * b2
            as_ = n11 * b2 - n12 * b1
            aw = i33 * Q3 - t13 * aF - t23 * as_
            ap = mp * iJA
            an = mn * iJA
            if double_stance:
                # the other foot closes the linkage by its force (Rx, Ry): EQUATIONS 6
                uG2 = uG * uG
                om = self.closing_rate
                vx_ = e * uF + lc * us - ew * uG - lcw * uw
                vy_ = f * uF - ls * us - fw * uG + lsw * uw
                bx = fw * uG2 - lsw * uw2 - f * uF2 + ls * us2 - om * (2.0 * vx_ + om * gap_x)
                by = dfw * uG2 - lcw * uw2 - df * uF2 + lc * us2 - om * (2.0 * vy_ + om * gap)
                TG -= Cw * uG
                r1 = bx - (e * aF + lc * as_ - lcw * aw)
                r2 = by - (f * aF - ls * as_ + lsw * aw)
                r3 = -TG
                Rx = (c11 * r1 + c12 * r2 + c13 * r3) * idet
                Ry = (c12 * r1 + c22 * r2 + c23 * r3) * idet
                aG = (c13 * r1 + c23 * r2 + c33 * r3) * idet
                aF += x1 * Rx + y1 * Ry
                as_ += x2 * Rx + y2 * Ry
                aw += x3 * Rx + y3 * Ry
            elif massless:
                aG = aw + an
            else:
                aG = TG * iJf
            if stage == 0:
                # force of the floor on the stance foot: rate of the whole momentum less gravity and the other foot
                Px += M * e * aF + Us * as_ - Aw * aw - Rx
                Py += M * f * aF - Vs * as_ + Bw * aw - Ry
                if outer_stance:
                    self.outer_Fx = Px
                    self.outer_Fy = Py
                    self.inner_Fx = Rx
                    self.inner_Fy = Ry
                    self.foot_outer_acc = aF
                    self.leg_outer_acc = as_
                    self.leg_inner_acc = aw
                    self.foot_inner_acc = aG
                    self.motor_outer_acc = ap
                    self.motor_inner_acc = an
                else:
                    self.inner_Fx = Px
                    self.inner_Fy = Py
                    self.outer_Fx = Rx
                    self.outer_Fy = Ry
                    self.foot_inner_acc = aF
                    self.leg_inner_acc = as_
                    self.leg_outer_acc = aw
                    self.foot_outer_acc = aG
                    self.motor_inner_acc = ap
                    self.motor_outer_acc = an
                if stages == 1:
                    return
                # k: first accelerations; q: sums k1 + k2 + k3
                qF = kF = aF
                qs = ks_ = as_
                qw = kw = aw
                qG = kG = aG
                qp = kp = ap
                qn = kn = an
                F = F0 + half * (uF0 + quarter * aF)
                th = th0 + half * (us0 + quarter * as_)
                tw = tw0 + half * (uw0 + quarter * aw)
                G = G0 + half * (uG0 + quarter * aG)
                p = p0 + half * (up0 + quarter * ap)
                n = n0 + half * (un0 + quarter * an)
                a_s = F - th
                a_w = G - tw
                hip = th - tw
                c = half
            elif stage < 3:
                qF += aF
                qs += as_
                qw += aw
                qG += aG
                qp += ap
                qn += an
                if stage == 2:
                    F = F0 + h * (uF0 + half * aF)
                    th = th0 + h * (us0 + half * as_)
                    tw = tw0 + h * (uw0 + half * aw)
                    G = G0 + h * (uG0 + half * aG)
                    p = p0 + h * (up0 + half * ap)
                    n = n0 + h * (un0 + half * an)
                    a_s = F - th
                    a_w = G - tw
                    hip = th - tw
                    if not double_stance:
                        # the legs' geometry at the angles of the step's end: it serves the next step as well
                        F = F0 + h * (uF0 + sixth * qF)
                        th = th0 + h * (us0 + sixth * qs)
                        tw = tw0 + h * (uw0 + sixth * qw)
                        G = G0 + h * (uG0 + sixth * qG)
                    c = h
            if stage < 3:
                uF = uF0 + c * aF
                us = us0 + c * as_
                uw = uw0 + c * aw
                uG = uG0 + c * aG
                up = up0 + c * ap
                un = un0 + c * an
        if outer_stance:
            self.known_foot_outer, self.known_leg_outer, self.known_leg_inner, self.known_foot_inner = F, th, tw, G
            self.sin_foot_outer, self.cos_foot_outer, self.sin_leg_outer, self.cos_leg_outer = sF, cF, st, ct
            self.sin_leg_inner, self.cos_leg_inner, self.sin_foot_inner, self.cos_foot_inner = sw, cw, sG, cG
        else:
            self.known_foot_inner, self.known_leg_inner, self.known_leg_outer, self.known_foot_outer = F, th, tw, G
            self.sin_foot_inner, self.cos_foot_inner, self.sin_leg_inner, self.cos_leg_inner = sF, cF, st, ct
            self.sin_leg_outer, self.cos_leg_outer, self.sin_foot_outer, self.cos_foot_outer = sw, cw, sG, cG
        if double_stance:
            F = F0 + h * (uF0 + sixth * qF)
            th = th0 + h * (us0 + sixth * qs)
            tw = tw0 + h * (uw0 + sixth * qw)
            G = G0 + h * (uG0 + sixth * qG)
        p = p0 + h * (up0 + sixth * qp)
        n = n0 + h * (un0 + sixth * qn)
        # k1 + 2 k2 + 2 k3 + k4
        uF = uF0 + sixth * (2.0 * qF - kF + aF)
        us = us0 + sixth * (2.0 * qs - ks_ + as_)
        uw = uw0 + sixth * (2.0 * qw - kw + aw)
        uG = uG0 + sixth * (2.0 * qG - kG + aG)
        up = up0 + sixth * (2.0 * qp - kp + ap)
        un = un0 + sixth * (2.0 * qn - kn + an)
        if outer_stance:
            self.foot_outer = F
            self.leg_outer = th
            self.leg_inner = tw
            self.foot_inner = G
            self.motor_outer = p
            self.motor_inner = n
            self.foot_outer_rate = uF
            self.leg_outer_rate = us
            self.leg_inner_rate = uw
            self.foot_inner_rate = uG
            self.motor_outer_rate = up
            self.motor_inner_rate = un
        else:
            self.foot_inner = F
            self.leg_inner = th
            self.leg_outer = tw
            self.foot_outer = G
            self.motor_inner = p
            self.motor_outer = n
            self.foot_inner_rate = uF
            self.leg_inner_rate = us
            self.leg_outer_rate = uw
            self.foot_outer_rate = uG
            self.motor_inner_rate = up
            self.motor_outer_rate = un
        if double_stance:
            self.update_pose()
            return
        # the geometry of stage 3 is that of the end: `update_pose` with what stands here (EQUATIONS 4)
        self.hip_x = Xs + r * (F - sg) - f + ls
        self.hip_y = Ys + e + lc
        if outer_stance:
            self.gap_outer = 0.0
            self.gap_inner = gap
        else:
            self.gap_outer = gap
            self.gap_inner = 0.0

    def _stop(self, angle: cython.double, rate: cython.double) -> cython.double:
        """Torque of an ankle stop on the foot: a spring and damper that can only push (EQUATIONS 2.5)."""
        torque: cython.double
        if angle < self.stop_low:
            torque = self.stop_k * (self.stop_low - angle) - self.stop_c * rate
            return torque if torque > 0.0 else 0.0
        torque = self.stop_k * (self.stop_high - angle) - self.stop_c * rate
        return torque if torque < 0.0 else 0.0

    def _exact_spring(self, angle: cython.double) -> cython.double:
        """Torque of the hip spring by its geometry (EQUATIONS 2.4)."""
        length: cython.double = sqrt(self.spring_aabb - 2.0 * self.spring_ab * cos(angle))
        return 2.0 * self.spring_k * self.spring_ab * (1.0 - self.spring_l0 / length) * sin(angle)

    def _ask_terms(
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
    ) -> cython.void:
        """Let the additional terms set their torques for this state, in fixed legs (EQUATIONS 12)."""
        if outer_stance:
            self.terms.joint_torques(self, hip, hip_rate, a_s, ra_s, a_w, ra_w, p, up, n, un)
        else:
            self.terms.joint_torques(self, -hip, -hip_rate, a_w, ra_w, a_s, ra_s, n, un, p, up)

    # ---- motion in the air or in the operator's hands ---------------------------------------------------------

    def in_air(self, h: cython.double, stages: cython.longlong) -> cython.void:
        """One step as `on_feet` makes it, of `h` seconds in flight or held (EQUATIONS 7); stages 4, or 1 to look."""
        held: cython.bint = self.mode == 0
        locked: cython.bint = held and self.lock_hip
        standing: cython.bint = held and self.standing
        outer_stands: cython.bint = standing and self.stance == 0
        inner_stands: cython.bint = standing and self.stance == 1
        massless: cython.bint = self.Jf == 0.0
        with_terms: cython.bint = self.terms is not None
        stage: cython.longlong
        M: cython.double = self.M
        JH: cython.double = self.JH
        iJA: cython.double = self.inverse_JA
        iJf: cython.double = self.inverse_Jf
        gx: cython.double = self.gx
        gy: cython.double = self.gy
        r: cython.double = self.r
        d: cython.double = self.d
        eps: cython.double = self.inverse_smoothing
        mco: cython.double = self.mc_outer
        mwo: cython.double = self.mw_outer
        mci: cython.double = self.mc_inner
        mwi: cython.double = self.mw_inner
        ks: cython.double = self.ks
        low: cython.double = self.stop_low
        high: cython.double = self.stop_high
        F: cython.double = self.foot_outer
        th: cython.double = self.leg_outer
        tw: cython.double = self.leg_inner
        G: cython.double = self.foot_inner
        p: cython.double = self.motor_outer
        n: cython.double = self.motor_inner
        uF: cython.double = self.foot_outer_rate
        us: cython.double = self.leg_outer_rate
        uw: cython.double = self.leg_inner_rate
        uG: cython.double = self.foot_inner_rate
        up: cython.double = self.motor_outer_rate
        un: cython.double = self.motor_inner_rate
        o_drive, o_coulomb, o_viscous = self.outer_drive, self.outer_coulomb, self.outer_viscous
        i_drive, i_coulomb, i_viscous = self.inner_drive, self.inner_coulomb, self.inner_viscous
        hip_drive, hip_coulomb, hip_viscous = self.hip_drive, self.hip_coulomb, self.hip_viscous
        exact_spring: cython.bint = self.exact_spring
        kh: cython.double = self.kh
        F0, th0, tw0, G0, p0, n0 = F, th, tw, G, p, n
        uF0, us0, uw0, uG0, up0, un0 = uF, us, uw, uG, up, un
        self._know_angles()
        st, ct, sw, cw = self.sin_leg_outer, self.cos_leg_outer, self.sin_leg_inner, self.cos_leg_inner
        if outer_stands:
            sS, cS, rolling = self.sin_foot_outer, self.cos_foot_outer, self.C_outer + 2.0
        else:
            sS, cS, rolling = self.sin_foot_inner, self.cos_foot_inner, self.C_inner + 2.0
        half: cython.double = 0.5 * h
        quarter: cython.double = 0.25 * h
        # what rests while the operator holds it
        as_ = aw = axh = ayh = 0.0
        for stage in range(stages):
            if stage != 2:
                # what depends on angles alone; stages 1 and 2 look at the same ones
                a_s = F - th
                a_w = G - tw
                pull_s = 0.0 if massless and not outer_stands else ks * (p - a_s)
                pull_w = 0.0 if massless and not inner_stands else ks * (n - a_w)
                if not locked:
                    if stage > 0:
                        st = sin(th)
                        ct = cos(th)
                        sw = sin(tw)
                        cw = cos(tw)
                    Ao = mco * ct + mwo * st
                    Bo = mco * st - mwo * ct
                    Ai = mci * cw + mwi * sw
                    Bi = mci * sw - mwi * cw
                    spring = self._exact_spring(th - tw) if exact_spring else kh * (th - tw)
                if standing:
                    # the stance foot rolls under the weight, the legs keep their lean (EQUATIONS 7.2)
                    foot = F if outer_stands else G
                    if stage > 0:
                        sS = sin(foot)
                        cS = cos(foot)
                    e = r - d * cS
                    f = d * sS
                    if foot < self.heel or foot > self.toe:
                        e = r * cos(self._excess(foot)) - d * cS
                        f -= r * sin(self._excess(foot))
                    push = M * (e * gx + f * gy)
                    weight_J = M * (e * e + f * f) + self.Jf
            Ts = pull_s
            Tw = pull_w
            mp = o_drive - o_coulomb * smoothed_sign(up * eps) - o_viscous * up - Ts
            mn = i_drive - i_coulomb * smoothed_sign(un * eps) - i_viscous * un - Tw
            if a_s < low or a_s > high:
                stop = self._stop(a_s, uF - us)
                Ts += stop
                if massless:
                    mp += stop
            if a_w < low or a_w > high:
                stop = self._stop(a_w, uG - uw)
                Tw += stop
                if massless:
                    mn += stop
            hd = us - uw
            Th = 0.0
            if not locked:
                Th = hip_drive - hip_coulomb * smoothed_sign(hd * eps) - hip_viscous * hd - spring
            if with_terms:
                self._ask_terms(True, th - tw, a_s, a_w, p, n, hd, uF - us, uG - uw, up, un)
                Th += self.extra_hip
                Ts += self.extra_outer
                Tw += self.extra_inner
                mp += self.extra_outer_motor
                mn += self.extra_inner_motor
                if massless:
                    mp += self.extra_outer
                    mn += self.extra_inner
            ap = mp * iJA
            an = mn * iJA
            if not held:
                # eliminate the hip's acceleration less gravity (EQUATIONS 7.1)
                bx = -(Bo * us * us + Bi * uw * uw) / M
                by = -(Ao * us * us + Ai * uw * uw) / M
                n11 = self.J_outer + JH - (Ao * Ao + Bo * Bo) / M
                n22 = self.J_inner + JH - (Ai * Ai + Bi * Bi) / M
                n12 = -JH - (Ao * Ai + Bo * Bi) / M
                b1 = Th - Ts + Ao * bx - Bo * by
                b2 = -Th - Tw + Ai * bx - Bi * by
                inv = 1.0 / (n11 * n22 - n12 * n12)
                as_ = (n22 * b1 - n12 * b2) * inv
                aw = (n11 * b2 - n12 * b1) * inv
                axh = bx + (Ao * as_ + Ai * aw) / M + gx
                ayh = by - (Bo * as_ + Bi * aw) / M + gy
            elif not locked:
                # the hip rests: gravity as if the hip were accelerated by its opposite
                aw = (-Th - Tw - Ai * gx + Bi * gy) / (self.J_inner + JH)
            if massless:
                aF = as_ + ap
                aG = aw + an
            else:
                aF = Ts * iJf
                aG = Tw * iJf
            if outer_stands:
                aF = (Ts - rolling * uF + push) / weight_J
            elif inner_stands:
                aG = (Tw - rolling * uG + push) / weight_J
            if stage == 0:
                self.foot_outer_acc = aF
                self.leg_outer_acc = as_
                self.leg_inner_acc = aw
                self.foot_inner_acc = aG
                self.motor_outer_acc = ap
                self.motor_inner_acc = an
                self.hip_ay = ayh
                self.outer_Fx = -M * gx if outer_stands else 0.0
                self.outer_Fy = -M * gy if outer_stands else 0.0
                self.inner_Fx = -M * gx if inner_stands else 0.0
                self.inner_Fy = -M * gy if inner_stands else 0.0
                if stages == 1:
                    return
                # sums: q of k1 + k2 + k3 for the positions, v of k1 + 2 k2 + 2 k3 for the rates
                qF = vF = aF
                qs = vs = as_
                qw = vw = aw
                qG = vG = aG
                qp = vp = ap
                qn = vn = an
                qx = vx = axh
                qy = vy = ayh
                F = F0 + half * (uF0 + quarter * aF)
                th = th0 + half * (us0 + quarter * as_)
                tw = tw0 + half * (uw0 + quarter * aw)
                G = G0 + half * (uG0 + quarter * aG)
                p = p0 + half * (up0 + quarter * ap)
                n = n0 + half * (un0 + quarter * an)
                c = half
            elif stage < 3:
                qF += aF
                qs += as_
                qw += aw
                qG += aG
                qp += ap
                qn += an
                vF += 2.0 * aF
                vs += 2.0 * as_
                vw += 2.0 * aw
                vG += 2.0 * aG
                vp += 2.0 * ap
                vn += 2.0 * an
                if not held:
                    qx += axh
                    qy += ayh
                    vx += 2.0 * axh
                    vy += 2.0 * ayh
                if stage == 2:
                    F = F0 + h * (uF0 + half * aF)
                    th = th0 + h * (us0 + half * as_)
                    tw = tw0 + h * (uw0 + half * aw)
                    G = G0 + h * (uG0 + half * aG)
                    p = p0 + h * (up0 + half * ap)
                    n = n0 + h * (un0 + half * an)
                    c = h
            if stage < 3:
                uF = uF0 + c * aF
                us = us0 + c * as_
                uw = uw0 + c * aw
                uG = uG0 + c * aG
                up = up0 + c * ap
                un = un0 + c * an
        sixth: cython.double = h / 6.0
        self.foot_outer = F0 + h * (uF0 + sixth * qF)
        self.leg_outer = th0 + h * (us0 + sixth * qs)
        self.leg_inner = tw0 + h * (uw0 + sixth * qw)
        self.foot_inner = G0 + h * (uG0 + sixth * qG)
        self.motor_outer = p0 + h * (up0 + sixth * qp)
        self.motor_inner = n0 + h * (un0 + sixth * qn)
        self.foot_outer_rate = uF0 + sixth * (vF + aF)
        self.leg_outer_rate = us0 + sixth * (vs + as_)
        self.leg_inner_rate = uw0 + sixth * (vw + aw)
        self.foot_inner_rate = uG0 + sixth * (vG + aG)
        self.motor_outer_rate = up0 + sixth * (vp + ap)
        self.motor_inner_rate = un0 + sixth * (vn + an)
        if not held:
            self.hip_x += h * (self.hip_vx + sixth * qx)
            self.hip_y += h * (self.hip_vy + sixth * qy)
            self.hip_vx += sixth * (vx + axh)
            self.hip_vy += sixth * (vy + ayh)

    # ---- impacts ----------------------------------------------------------------------------------------------

    def impact(self, outer: cython.bint, inner: cython.bint) -> None:
        """Rates just after the feet named here are at rest on the floor (EQUATIONS 8).

        The motors, behind their cables, keep their rates. Impulses are left in P_stance_* and P_swing_*, where
        the stance foot is the one of `self.stance` before the impact.
        """
        n: cython.longlong = 6 + 2 * outer + 2 * inner
        row: cython.longlong
        column: cython.longlong
        foot: cython.longlong
        Ao: cython.double = self.mc_outer * cos(self.leg_outer) + self.mw_outer * sin(self.leg_outer)
        Bo: cython.double = self.mc_outer * sin(self.leg_outer) - self.mw_outer * cos(self.leg_outer)
        Ai: cython.double = self.mc_inner * cos(self.leg_inner) + self.mw_inner * sin(self.leg_inner)
        Bi: cython.double = self.mc_inner * sin(self.leg_inner) - self.mw_inner * cos(self.leg_inner)
        Jf: cython.double = self.Jf
        e: cython.double
        f: cython.double
        excess: cython.double
        total: cython.double
        angle: cython.double
        lean: cython.double
        before = (
            self.hip_vx,
            self.hip_vy,
            self.leg_outer_rate,
            self.leg_inner_rate,
            self.foot_outer_rate,
            self.foot_inner_rate,
        )
        a: cython.p_double = self.matrix
        for row in range(110):
            a[row] = 0.0
        # rows of 11: unknowns vx, vy, leg o, leg i, foot o, foot i, impulses; last column the right-hand side
        a[0] = self.M
        a[2] = -Ao
        a[3] = -Ai
        a[11 + 1] = self.M
        a[11 + 2] = Bo
        a[11 + 3] = Bi
        a[22] = -Ao
        a[22 + 1] = Bo
        a[22 + 2] = self.J_outer + self.JH
        a[22 + 3] = -self.JH
        a[33] = -Ai
        a[33 + 1] = Bi
        a[33 + 2] = -self.JH
        a[33 + 3] = self.J_inner + self.JH
        a[44 + 4] = Jf
        a[55 + 5] = Jf
        for row in range(6):
            total = 0.0
            for column in range(6):
                total += a[11 * row + column] * before[column]
            a[11 * row + 10] = total
        row = 6
        for foot in range(2):
            if not (outer if foot == 0 else inner):
                if Jf == 0.0:  # a massless foot in the air follows its motor
                    a[11 * (4 + foot) + 4 + foot] = 1.0
                    a[11 * (4 + foot) + 2 + foot] = -1.0
                    a[11 * (4 + foot) + 10] = self.motor_outer_rate if foot == 0 else self.motor_inner_rate
                continue
            angle = self.foot_outer if foot == 0 else self.foot_inner
            lean = self.leg_outer if foot == 0 else self.leg_inner
            excess = self._excess(angle)
            e = self.r * cos(excess) - self.d * cos(angle)
            f = self.d * sin(angle) - self.r * sin(excess)
            a[11 * row] = 1.0
            a[11 * row + 2 + foot] = -self.el * cos(lean)
            a[11 * row + 4 + foot] = -e
            a[11 * (row + 1) + 1] = 1.0
            a[11 * (row + 1) + 2 + foot] = self.el * sin(lean)
            a[11 * (row + 1) + 4 + foot] = -f
            for column in range(6):
                a[11 * column + row] = -a[11 * row + column]
                a[11 * column + row + 1] = -a[11 * (row + 1) + column]
            row += 2
        self._eliminate(n)
        x: cython.p_double = self.solution
        self.hip_vx = x[0]
        self.hip_vy = x[1]
        self.leg_outer_rate = x[2]
        self.leg_inner_rate = x[3]
        self.foot_outer_rate = x[4]
        self.foot_inner_rate = x[5]
        self.P_stance_x = 0.0
        self.P_stance_y = 0.0
        self.P_swing_x = 0.0
        self.P_swing_y = 0.0
        row = 6
        for foot in range(2):
            if outer if foot == 0 else inner:
                if foot == self.stance:
                    self.P_stance_x = x[row]
                    self.P_stance_y = x[row + 1]
                else:
                    self.P_swing_x = x[row]
                    self.P_swing_y = x[row + 1]
                row += 2

    def _eliminate(self, n: cython.longlong) -> cython.void:
        """Solve the first n equations of `matrix` (rows of 11, right-hand side last) by Gauss with pivots."""
        i: cython.longlong
        j: cython.longlong
        k: cython.longlong
        best: cython.longlong
        factor: cython.double
        held: cython.double
        a: cython.p_double = self.matrix
        x: cython.p_double = self.solution
        for k in range(n):
            best = k
            for i in range(k + 1, n):
                if fabs(a[11 * i + k]) > fabs(a[11 * best + k]):
                    best = i
            if best != k:
                for j in range(11):
                    held = a[11 * k + j]
                    a[11 * k + j] = a[11 * best + j]
                    a[11 * best + j] = held
            for i in range(k + 1, n):
                factor = a[11 * i + k] / a[11 * k + k]
                if factor != 0.0:
                    for j in range(k, n):
                        a[11 * i + j] -= factor * a[11 * k + j]
                    a[11 * i + 10] -= factor * a[11 * k + 10]
        for k in range(n - 1, -1, -1):
            factor = a[11 * k + 10]
            for j in range(k + 1, n):
                factor -= a[11 * k + j] * x[j]
            x[k] = factor / a[11 * k + k]

    # ---- a step with its events -------------------------------------------------------------------------------

    def advance(self, h: cython.double) -> None:
        """Move on by `h` seconds under constant laws of the motors' torques, events located inside (EQUATIONS 15)."""
        remaining: cython.double = h
        used: cython.double
        tries: cython.longlong = 0
        self.elapsed = 0.0
        while remaining > 0.0 and self.mode != 4:
            tries += 1
            if self.mode != 0:  # nothing happens in the operator's hands that a step would be taken back for
                self._save()
            if self.mode == 1 or self.mode == 2:
                self.on_feet(remaining, 4)
                if (self.outer_Fy < 0.0 or self.inner_Fy < 0.0) and tries < 20 and self._pulled_now(remaining):
                    continue  # a foot left the floor at the start of this piece: nothing has moved yet
            else:
                self.in_air(remaining, 4)
                self.update_pose()
            used = remaining
            if tries < 20 and self.mode != 0 and self._crossed() < 0.0:
                used = self._locate(remaining)
                self.elapsed += used
                self._act()
            else:
                self.elapsed += used
            remaining -= used
        if self.mode == 4:
            self.elapsed = h
        self.time_s += h
        if self.mode != 0 and self.mode != 4:
            self._watch(h)

    def _save(self) -> cython.void:
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

    def _restore(self) -> cython.void:
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

    def _rise(self, leg: cython.longlong) -> cython.double:
        """Vertical acceleration of a chain's hip end over a resting contact: f foot'' - l sin leg'' + bias."""
        foot: cython.double = self.foot_outer if leg == 0 else self.foot_inner
        lean: cython.double = self.leg_outer if leg == 0 else self.leg_inner
        foot_rate: cython.double = self.foot_outer_rate if leg == 0 else self.foot_inner_rate
        leg_rate: cython.double = self.leg_outer_rate if leg == 0 else self.leg_inner_rate
        foot_acc: cython.double = self.foot_outer_acc if leg == 0 else self.foot_inner_acc
        leg_acc: cython.double = self.leg_outer_acc if leg == 0 else self.leg_inner_acc
        excess: cython.double = self._excess(foot)
        down: cython.double = self.d * cos(foot)
        if excess != 0.0:
            down -= self.r * cos(excess)
        return (
            (self.d * sin(foot) - self.r * sin(excess)) * foot_acc
            - self.el * sin(lean) * leg_acc
            + down * foot_rate * foot_rate
            - self.el * cos(lean) * leg_rate * leg_rate
        )

    def lets_go(self, leg: cython.longlong) -> cython.bint:
        """True when this foot, let go by the floor now, would rise: only then may it leave (EQUATIONS 9).

        A rigid foot that sticks can ask for a pull and yet, let go, drive into the floor, because letting go also
        takes the friction force away; on the robot it would slip there. It stays, and the pull is reported.
        """
        mode: cython.longlong = self.mode
        stance: cython.longlong = self.stance
        fo: cython.double = self.foot_outer
        fi: cython.double = self.foot_inner
        fo_rate: cython.double = self.foot_outer_rate
        fi_rate: cython.double = self.foot_inner_rate
        outer_Fx: cython.double = self.outer_Fx
        outer_Fy: cython.double = self.outer_Fy
        inner_Fx: cython.double = self.inner_Fx
        inner_Fy: cython.double = self.inner_Fy
        gap: cython.double
        rise: cython.double
        if mode == 2:
            self.mode = 1
            self.stance = 1 - leg
        else:
            self.mode = 3
        if self.Jf == 0.0:
            self.limp_foot(leg)
        self.update_pose()
        gap = self.gap_outer if leg == 0 else self.gap_inner
        if self.mode == 1:
            self.on_feet(0.0, 1)
            rise = self._rise(1 - leg) - self._rise(leg)
        else:
            self.in_air(0.0, 1)
            rise = self.hip_ay - self._rise(leg)
        self.mode = mode
        self.stance = stance
        self.foot_outer = fo
        self.foot_inner = fi
        self.foot_outer_rate = fo_rate
        self.foot_inner_rate = fi_rate
        self.outer_Fx = outer_Fx
        self.outer_Fy = outer_Fy
        self.inner_Fx = inner_Fx
        self.inner_Fy = inner_Fy
        self.update_pose()
        # a massless foot turns to its motor's angle at once and may come clear, or down, by that alone
        if gap > 1e-9:
            return True
        return gap > -1e-9 and rise > 0.0

    def _pulled_now(self, h: cython.double) -> cython.bint:
        """Let a foot go that the floor would have to pull at the start of this piece of `h` seconds.

        True when one was: then the state is that of the start.
        """
        first: cython.longlong
        leg: cython.longlong
        k: cython.longlong
        force: cython.double
        if self.mode == 1:
            if (self.outer_Fy if self.stance == 0 else self.inner_Fy) >= 0.0:
                return False
        elif self.outer_Fy >= 0.0 and self.inner_Fy >= 0.0:
            return False
        self._restore()
        self.update_pose()
        first = 0 if self.outer_Fy < self.inner_Fy else 1
        for k in range(2):
            leg = first if k == 0 else 1 - first
            force = self.outer_Fy if leg == 0 else self.inner_Fy
            if force < 0.0 and self._may_leave(leg) and (self._sole_ready(leg) or self.lets_go(leg)):
                self.update_hip_rates()
                self._leave(leg)
                return True
        self.on_feet(h, 4)
        return False

    def _sole_ready(self, leg: cython.longlong) -> cython.bint:
        """True when this foot of a double stance is not ahead: let go, its sole stops it from driving in."""
        if self.mode != 2 or self.Jf == 0.0:
            return False
        return self._behind(1 - leg) - self._behind(leg) < self.strike_ahead

    def _may_leave(self, leg: cython.longlong) -> cython.bint:
        """Feet on the floor may leave it; the leading one in double stance only with `lift_leading`."""
        if self.mode == 1:
            return leg == self.stance
        return self.lift_leading or leg != self.last_strike_leg

    def _crossed(self) -> cython.double:
        """Below 0 when an event lies behind. `event`: 1, 2 outer, inner foot touches; 3, 4 outer, inner foot leaves."""
        value: cython.double = 1.0
        other: cython.double
        self.event = 0
        if self.mode == 2:
            self.on_feet(0.0, 1)
            if self._may_leave(0):
                other = self.outer_Fy
                if other >= 0.0 or self._sole_ready(0) or self.lets_go(0):
                    value = other
                    self.event = 3
            if self._may_leave(1):
                other = self.inner_Fy
                if other < value and (other >= 0.0 or self._sole_ready(1) or self.lets_go(1)):
                    value = other
                    self.event = 4
            return value
        if self.mode == 1:
            if self.stance == 0:
                value = self.gap_inner + (0.0 if self.inner_armed else 2e-6)
            else:
                value = self.gap_outer + (0.0 if self.outer_armed else 2e-6)
            # only a foot ahead can strike; beside and behind it brushes with its sole
            if value < 0.0 and self._ahead() <= self.strike_ahead:
                return 1.0
            self.event = 2 - self.stance  # the other foot
            return value
        self.event = 1
        value = self.gap_outer + (0.0 if self.outer_armed else 2e-6)
        other = self.gap_inner + (0.0 if self.inner_armed else 2e-6)
        if other < value:
            self.event = 2
            return other
        return value

    def _ahead(self) -> cython.double:
        """How far the swing foot's lowest point is ahead of the stance foot's, m."""
        if self.stance == 0:
            return self._behind(0) - self._behind(1)
        return self._behind(1) - self._behind(0)

    def _try(self, h: cython.double) -> cython.double:
        """The event function after a piece of `h` seconds from the saved state."""
        self._restore()
        if self.mode == 1 or self.mode == 2:
            self.on_feet(h, 4)
        else:
            self.in_air(h, 4)
            self.update_pose()
        return self._crossed()

    def _locate(self, h: cython.double) -> cython.double:
        """Time in (0, h] at which the event function falls through 0, within 1e-10 s (Illinois method)."""
        low: cython.double = 0.0
        high: cython.double = h
        middle: cython.double
        value: cython.double
        f_high: cython.double = self._crossed()
        f_low: cython.double
        side: cython.longlong = 0
        tries: cython.longlong = 0
        self._restore()
        self.update_pose()
        f_low = self._crossed()
        if f_low <= 0.0:
            # already behind at the start: it happens now
            return 0.0
        while high - low > 1e-10 and tries < 60:
            tries += 1
            middle = (low * f_high - high * f_low) / (f_high - f_low)
            if not low < middle < high:
                middle = 0.5 * (low + high)
            value = self._try(middle)
            if value > 0.0:
                low = middle
                f_low = value
                if side == 1:
                    f_high *= 0.5
                side = 1
            else:
                high = middle
                f_high = value
                if side == -1:
                    f_low *= 0.5
                side = -1
            if value > -1e-13 and value <= 0.0:
                break
        self._try(high)
        return high

    def _act(self) -> None:
        """Do what the located event asks for."""
        self.update_hip_rates()
        if self.event == 1:
            self._touch(0)
        elif self.event == 2:
            self._touch(1)
        elif self.event == 3:
            self._leave(0)
        elif self.event == 4:
            self._leave(1)

    def event_time_ns(self) -> cython.longlong:
        """Instant of the running event, ns."""
        return self.step_start_ns + int(self.elapsed * 1e9 + 0.5)

    def _touch(self, foot: cython.longlong) -> None:
        """The foot meets the floor: anchor it, take the impact, count a step when it strikes ahead."""
        other: cython.longlong = 1 - foot
        was_flight: cython.bint = self.mode == 3
        ahead: cython.double
        angle: cython.double = self.foot_outer if foot == 0 else self.foot_inner
        lean: cython.double = self.leg_outer if foot == 0 else self.leg_inner
        energy: cython.double = self.energy_J()
        strike: cython.bint
        # a foot that strikes with its sole already pressed stands as deep as it is
        if foot == 0:
            self.anchor_outer = self.hip_x - self.chain_x(angle, lean)
            self.outer_armed = False
            self.height_outer += self.gap_outer
        else:
            self.anchor_inner = self.hip_x - self.chain_x(angle, lean)
            self.inner_armed = False
            self.height_inner += self.gap_inner
        ahead = self.contact_x(foot) - self.contact_x(other)
        strike = foot != self.last_strike_leg and ahead > self.strike_ahead
        if was_flight:
            self.impact(foot == 0, foot == 1)
            if foot != self.stance:
                self.P_stance_x = 0.0
                self.P_stance_y = 0.0
            self.mode = 1
            self.stance = foot
        else:
            self._save()
            self.impact(True, True)
            # the rule of the appendix keeps the trailing foot on the floor, by a pull if need be (EQUATIONS 8)
            if self.P_stance_y < 0.0 and self.unilateral:
                self._restore()
                self.impact(foot == 0, foot == 1)
                self.mode = 1
                if other == 0:
                    self.outer_armed = False
                else:
                    self.inner_armed = False
            else:
                self.mode = 2
            self.stance = foot
        self.record.touch(
            self.event_time_ns(),
            foot,
            strike,
            ahead,
            self.contact_x(foot),
            angle,
            (self.P_stance_x, self.P_stance_y, self.P_swing_x, self.P_swing_y),
            energy - self.energy_J(),
            self.mode == 2,
            self.passing_gap,
            self.height_outer if foot == 0 else self.height_inner,
        )
        self.changes += 1
        if strike:
            self.passing_gap = 1.0
            self.last_strike_leg = foot
            self.foothold_due = True
            self.released_s = self.time_s
        self.brush = False
        if self.mode == 1 and self.Jf == 0.0:
            self.limp_foot(other)

    def _leave(self, foot: cython.longlong) -> None:
        """The foot goes off the floor; the other one carries, or none does."""
        if foot == 0:
            self.outer_armed = False
        else:
            self.inner_armed = False
        self.update_hip_rates()
        if self.mode == 2:
            self.mode = 1
            self.stance = 1 - foot
            self.brush = self._ahead() <= self.strike_ahead
            self.brushing = True  # it leaves: only a later touch counts as one
        else:
            self.mode = 3
        if self.Jf == 0.0:
            self.limp_foot(foot)
            if self.mode == 3:
                self.limp_foot(1 - foot)
        self.update_pose()
        self.record.leave(self.event_time_ns(), foot, self.mode == 3)
        self.changes += 1

    def _watch(self, h: cython.double) -> None:
        """Once per step: arm feet that are clear, draw footholds, keep the extremes, judge falls."""
        s: cython.double
        w: cython.double
        gap: cython.double
        if not self.outer_armed and self.gap_outer > 1e-6:
            self.outer_armed = True
        if not self.inner_armed and self.gap_inner > 1e-6:
            self.inner_armed = True
        if self.stance == 0:
            s, w, gap = self.leg_outer, self.leg_inner, self.gap_inner
        else:
            s, w, gap = self.leg_inner, self.leg_outer, self.gap_outer
        if self.mode == 1:
            if self.foothold_due and 1 - self.stance != self.last_strike_leg and s > w:
                # the swing ankle passes the stance ankle: from here its next foothold counts
                self.foothold_due = False
                if self.stance == 0:
                    self.height_inner = self.floor.next_height()
                else:
                    self.height_outer = self.floor.next_height()
                self.update_pose()
            # near the floor and not ahead: the sole may touch in the next step
            self.brush = gap < 1e-3 and self._ahead() <= self.strike_ahead
            if gap < 0.0 and self.brush:
                self.brush_s += h
                if not self.brushing:
                    self.brushing = True
                    self.record.brush(not self.foothold_due)
                    if not self.foothold_due:
                        self.scuff_time_s = self.time_s
            elif gap > 1e-3:
                self.brushing = False
            # clearance: the lowest gap while the swing foot is less than 50 mm from passing
            if gap < self.passing_gap and -0.05 < self.el * (s - w) < 0.05:
                self.passing_gap = gap
        self._keep_forces(h)
        if self.hip_y < self.fall_height * self.el or s > self.fall_lean or s < -self.fall_lean:
            if self.scuff_time_s >= 0.0 and self.time_s - self.scuff_time_s < 0.5:
                self._fall("tripped")
            elif s > 0.0:
                self._fall("fell forward")
            else:
                self._fall("fell backward")
        elif s - w > self.fall_split or w - s > self.fall_split:
            self._fall("legs split")
        elif self.time_s - self.released_s > self.stall_s:
            self._fall("stalled")

    def _keep_forces(self, h: cython.double) -> cython.void:
        """Worst friction ratio and pull of the walk; time with more than the floor's friction."""
        outer: cython.double = self.outer_Fy
        inner: cython.double = self.inner_Fy
        outer_along: cython.double = fabs(self.outer_Fx)
        inner_along: cython.double = fabs(self.inner_Fx)
        least: cython.double = outer if outer < inner else inner
        slips: cython.bint = False
        if outer > 5.0:  # N; below that the ratio says nothing: chosen by us
            if outer_along > self.friction_ratio_max * outer:
                self.friction_ratio_max = outer_along / outer
            slips = outer_along > self.mu * outer
        if inner > 5.0:
            if inner_along > self.friction_ratio_max * inner:
                self.friction_ratio_max = inner_along / inner
            slips = slips or inner_along > self.mu * inner
        if slips:
            self.slip_s += h
        if least < self.normal_force_min:
            self.normal_force_min = least
        if least < -1.0:
            self.pull_s += h

    def _fall(self, cause) -> None:
        """The walk ends here: the body lies still, with the cause."""
        self.mode = 4
        self.cause = cause
        self.record.fall(self.event_time_ns(), cause)
        self.changes += 1
        self.foot_outer_rate = 0.0
        self.leg_outer_rate = 0.0
        self.leg_inner_rate = 0.0
        self.foot_inner_rate = 0.0
        self.motor_outer_rate = 0.0
        self.motor_inner_rate = 0.0
        self.hip_vx = 0.0
        self.hip_vy = 0.0
        self.outer_Fx = 0.0
        self.outer_Fy = 0.0
        self.inner_Fx = 0.0
        self.inner_Fy = 0.0
