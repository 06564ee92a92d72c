# cython: boundscheck=False, wraparound=False
# (all indices in `saved` are literal)
"""One leg with its foot and its ankle motor; the body has two of them (EQUATIONS 1, 4).

All angles are positive clockwise seen with the walking direction to the right, that is in the forward direction:

    foot_angle   F, absolute, 0 with the sweet spot on the floor, positive rolled to the toe
    angle        th, of the leg, absolute, 0 upright, positive leaning forward (hip ahead of the ankle)
    motor_angle  p, of the ankle motor over its gear, relative to the leg; equal to F - th without cable stretch
"""

from typing import Final

import cython
from cython.cimports.libc.math import cos, sin

OUTER: Final = 0
INNER: Final = 1

# kg m^2. A massless foot that slides has no equation for its angle where its contact is below its ankle (f = 0 in
# EQUATIONS 4). Where feet may slide they have this at least; chosen by us: a tenth of a real foot's, and against its
# cable it swings at 60 Hz, which steps of 250 us follow.
# ROBOT PARITY: appendix 5 has massless feet; contact "sticking" keeps them.
LEAST_FOOT_INERTIA = 1e-4
RIGID = ("sticking", "unilateral")  # contacts in which a foot on the floor never slides

LEG_NAMES = ("outer", "inner")


@cython.final
@cython.cclass
class Leg:
    """State, contact, forces and parameters of one leg. `side`: OUTER or INNER; `parameters`: BodyParameters.

    Both legs have the same equations; they differ only in numbers, all of which are fields here. More than 40 fields,
    because a step reads nearly all of them: split in two (a leg and its foot) each would cost a second look-up.
    """

    # fields read at every step come first, next to each other
    foot_angle: cython.double
    angle: cython.double
    motor_angle: cython.double
    foot_rate: cython.double
    rate: cython.double
    motor_rate: cython.double
    known_foot: cython.double
    sin_foot: cython.double
    cos_foot: cython.double
    known_angle: cython.double
    sin_leg: cython.double
    cos_leg: cython.double
    drive: cython.double
    coulomb: cython.double
    viscous: cython.double
    Fx: cython.double
    Fy: cython.double
    foot_acc: cython.double
    acc: cython.double
    motor_acc: cython.double
    anchor: cython.double
    height: cython.double
    gap: cython.double
    hip_sign: cython.double
    el: cython.double
    r: cython.double
    d: cython.double
    heel: cython.double
    toe: cython.double
    Jf: cython.double
    inverse_Jf: cython.double
    C: cython.double
    mc: cython.double
    mw: cython.double
    mt: cython.double
    m22: cython.double
    i33: cython.double
    J: cython.double
    extra_ankle: cython.double
    extra_motor: cython.double
    impulse_x: cython.double
    impulse_y: cython.double
    side: cython.longlong
    slide: cython.longlong
    armed: cython.bint
    saved: cython.double[6]

    def __init__(self, side, parameters) -> None:
        p = parameters
        self.side = side
        # state (rad, rad/s)
        self.foot_angle = 0.0
        self.angle = 0.0
        self.motor_angle = 0.0
        self.foot_rate = 0.0
        self.rate = 0.0
        self.motor_rate = 0.0
        self.saved = [0.0] * 6
        # accelerations at the start of the last step, rad/s^2
        self.foot_acc = 0.0
        self.acc = 0.0
        self.motor_acc = 0.0
        # sines and cosines of the two angles that are named here; `know_leg` and `know_foot` bring them up to date
        self.known_foot = 0.0
        self.sin_foot = 0.0
        self.cos_foot = 1.0
        self.known_angle = 0.0
        self.sin_leg = 0.0
        self.cos_leg = 1.0

        # contact, m: where the sweet spot of the standing foot would touch, height of its foothold, gap above it
        self.anchor = 0.0
        self.height = 0.0
        self.gap = 0.0
        self.armed = False  # the foot has been clear of the floor since it left it
        self.slide = 0  # which way the standing foot slides: 1 forwards, -1 backwards, 0 it sticks or is in the air
        # force of the floor at the start of the last step, N; impulse at the last impact, N s
        self.Fx = 0.0
        self.Fy = 0.0
        self.impulse_x = 0.0
        self.impulse_y = 0.0

        # torque of the ankle motor during a step: drive - coulomb tanh(rate / epsilon) - viscous rate, at the joint
        self.drive = 0.0
        self.coulomb = 0.0
        self.viscous = 0.0
        # additional torques of the terms, set by them: on the ankle (joint side) and on the motor
        self.extra_ankle = 0.0
        self.extra_motor = 0.0

        # parameters in the letters of EQUATIONS
        if side == OUTER:
            self.mc = p.outer_mass_moment_kg_m
            self.mw = p.outer_mass_offset_kg_m
            self.J = p.outer_hip_inertia_kg_m2
            self.C = p.outer_rolling_friction_Nms
            self.r = p.outer_foot_radius_m
            self.d = p.outer_ankle_offset_m
        else:
            self.mc = p.inner_mass_moment_kg_m
            self.mw = p.inner_mass_offset_kg_m
            self.J = p.inner_hip_inertia_kg_m2
            self.C = p.inner_rolling_friction_Nms
            self.r = p.inner_foot_radius_m
            self.d = p.inner_ankle_offset_m
        # The hip angle h = th_outer - th_inner grows with the outer leg and falls with the inner one (EQUATIONS 1):
        # the sign with which torques and angles of the hip, which count from outer to inner, act on this leg.
        self.hip_sign = 1.0 if side == OUTER else -1.0
        self.el = p.leg_length_m
        self.heel = p.arc_heel_rad
        self.toe = p.arc_toe_rad
        self.Jf = p.foot_inertia_kg_m2
        if p.contact not in RIGID and self.Jf < LEAST_FOOT_INERTIA:
            self.Jf = LEAST_FOOT_INERTIA
        self.inverse_Jf = 1.0 / self.Jf if self.Jf > 0.0 else 0.0
        # from these alone: the constant part of the mass matrix, as stance leg (m22, mt) and as the other one (1 / m33)
        M = p.total_mass_kg
        JH = p.hip_rotor_inertia_kg_m2
        self.m22 = M * self.el * self.el - 2.0 * self.el * self.mc + self.J + JH
        self.mt = M * self.el - self.mc
        self.i33 = 1.0 / (self.J + JH)

    # ---- where things are -----------------------------------------------------------------------------------

    @cython.cfunc
    def know_leg(self) -> cython.void:
        """Sine and cosine of the leg's present angle into the fields; steps on the floor leave them there."""
        if self.angle != self.known_angle:
            self.known_angle = self.angle
            self.sin_leg = sin(self.angle)
            self.cos_leg = cos(self.angle)

    @cython.cfunc
    def know_foot(self) -> cython.void:
        """As `know_leg`, of the foot's angle."""
        if self.foot_angle != self.known_foot:
            self.known_foot = self.foot_angle
            self.sin_foot = sin(self.foot_angle)
            self.cos_foot = cos(self.foot_angle)

    @cython.ccall
    @cython.exceptval(check=False)
    def excess(self, foot: cython.double) -> cython.double:
        """Angle by which the foot, at this angle, has rolled beyond the end of its arc (sigma), 0 on the arc."""
        if foot < self.heel:
            return foot - self.heel
        if foot > self.toe:
            return foot - self.toe
        return 0.0

    @cython.ccall
    @cython.exceptval(check=False)
    def chain_x(self, foot: cython.double, leg: cython.double) -> cython.double:
        """Hip ahead of the anchor of the standing foot at these two angles, m (EQUATIONS 4)."""
        excess: cython.double = self.excess(foot)
        return self.r * (foot - excess + sin(excess)) - self.d * sin(foot) + self.el * sin(leg)

    @cython.ccall
    @cython.exceptval(check=False)
    def chain_y(self, foot: cython.double, leg: cython.double) -> cython.double:
        """Hip above the foothold of the standing foot at these two angles, m (EQUATIONS 4)."""
        return self.r * cos(self.excess(foot)) - self.d * cos(foot) + self.el * cos(leg)

    @cython.cfunc
    @cython.exceptval(check=False)
    def reach(self) -> cython.double:
        """The lowest point of the foot below the hip, m: `chain_y` with the known sines (EQUATIONS 4)."""
        y: cython.double = self.el * self.cos_leg - self.d * self.cos_foot
        foot: cython.double = self.foot_angle
        if foot < self.heel or foot > self.toe:
            return y + self.r * cos(self.excess(foot))
        return y + self.r

    @cython.ccall
    @cython.exceptval(check=False)
    def behind(self) -> cython.double:
        """The lowest point of the foot behind the hip, m (EQUATIONS 4)."""
        foot: cython.double = self.foot_angle
        x: cython.double
        self.know_leg()
        self.know_foot()
        x = self.el * self.sin_leg - self.d * self.sin_foot
        if foot < self.heel or foot > self.toe:
            x += self.r * sin(self.excess(foot))
        return x

    @cython.cfunc
    @cython.exceptval(check=False)
    def rise(self) -> cython.double:
        """Vertical acceleration of the hip if the foot's contact rested: f ddF - l sin th ddth + bias (EQUATIONS 4)."""
        foot: cython.double = self.foot_angle
        excess: cython.double = self.excess(foot)
        down: cython.double = self.d * cos(foot)
        if excess != 0.0:
            down -= self.r * cos(excess)
        return (
            (self.d * sin(foot) - self.r * sin(excess)) * self.foot_acc
            - self.el * sin(self.angle) * self.acc
            + down * self.foot_rate * self.foot_rate
            - self.el * cos(self.angle) * self.rate * self.rate
        )

    # ---- what happens to it ---------------------------------------------------------------------------------

    @cython.ccall
    @cython.exceptval(check=False)
    def stretch(self) -> cython.double:
        """Of the ankle's cable, rad at the joint (EQUATIONS 1)."""
        return self.motor_angle - (self.foot_angle - self.angle)

    @cython.ccall
    def limp(self) -> cython.void:
        """Put a massless foot in the air where its motor holds it, q4 = q4m (EQUATIONS 5.4)."""
        self.foot_angle = self.angle + self.motor_angle
        self.foot_rate = self.rate + self.motor_rate

    @cython.ccall
    def lie(self) -> cython.void:
        """No motion and no force of the floor."""
        self.foot_rate = 0.0
        self.rate = 0.0
        self.motor_rate = 0.0
        self.Fx = 0.0
        self.Fy = 0.0

    @cython.cfunc
    def save(self) -> cython.void:
        """Keep the state for `restore`."""
        s: cython.p_double = self.saved
        s[0] = self.foot_angle
        s[1] = self.angle
        s[2] = self.motor_angle
        s[3] = self.foot_rate
        s[4] = self.rate
        s[5] = self.motor_rate

    @cython.cfunc
    def restore(self) -> cython.void:
        """Back to the state that `save` has kept."""
        s: cython.p_double = self.saved
        self.foot_angle = s[0]
        self.angle = s[1]
        self.motor_angle = s[2]
        self.foot_rate = s[3]
        self.rate = s[4]
        self.motor_rate = s[5]
