# cython: cdivision=True
# (only by determinants of inertia, which are above zero)
"""The equations of motion on one or two feet (EQUATIONS 5, 6), in their order and with their names.

The unknowns are the accelerations of (F_s, th_s, th_w), in arrays of three. s is the stance (reference) leg and w the
other one.
"""

import cython

from ranger_sim.plant.mechanics.friction import smoothed_sign
from ranger_sim.plant.mechanics.leg import Leg
from ranger_sim.plant.mechanics.leg_motion import LegMotion
from ranger_sim.plant.mechanics.parts import Ankle, HipJoint, Sole
from ranger_sim.plant.mechanics.term_torques import TermTorques


@cython.final
@cython.cclass
class StanceEquations:
    """The numbers of one evaluation, filled anew for each.

    `hip`, `ankle`, `sole`: parts of the body; `mass`: of the body (kg); `per_rad_s`: one over epsilon, the rate of
    smoothing; `closing_rate`: with which errors of the closed linkage decay (1/s). More than 40 fields, because these
    are the numbers of the equations.
    """

    s: LegMotion
    w: LegMotion
    hip: HipJoint
    ankle: Ankle
    sole: Sole
    terms: TermTorques
    double_stance: cython.bint
    brush: cython.bint
    M: cython.double
    gx: cython.double
    gy: cython.double
    per_rad_s: cython.double
    closing_rate: cython.double
    # terms that depend on angles alone
    hip_angle: cython.double
    gap: cython.double
    U: cython.double
    V: cython.double
    S: cython.double
    m11: cython.double
    m12: cython.double
    m13: cython.double
    m23: cython.double
    # m13 / m33 and m23 / m33, by which the leg w is eliminated, and the inverse n of the matrix that is left
    w1: cython.double
    w2: cython.double
    n11: cython.double
    n12: cython.double
    n22: cython.double
    # the closed linkage
    gap_x: cython.double
    Jx: cython.double[3]
    Jy: cython.double[3]
    MJx: cython.double[3]
    MJy: cython.double[3]
    c11: cython.double
    c12: cython.double
    c13: cython.double
    c22: cython.double
    c23: cython.double
    c33: cython.double
    inverse_determinant: cython.double
    # torques, forces and accelerations
    T_h: cython.double
    ax: cython.double
    ay: cython.double
    Px: cython.double
    Py: cython.double
    Q: cython.double[3]
    Rx: cython.double
    Ry: cython.double
    dd: cython.double[3]

    def __init__(self, hip, ankle, sole, mass, per_rad_s, closing_rate) -> None:
        self.hip = hip
        self.ankle = ankle
        self.sole = sole
        self.M = mass
        self.per_rad_s = per_rad_s
        self.closing_rate = closing_rate
        self.terms = None
        self.gx = 0.0
        self.gy = 0.0
        self.Jx = [0.0] * 3
        self.Jy = [0.0] * 3
        self.MJx = [0.0] * 3
        self.MJy = [0.0] * 3
        self.Q = [0.0] * 3
        self.dd = [0.0] * 3

    @cython.cfunc
    def begin(
        self, s: LegMotion, w: LegMotion, double_stance: cython.bint, brush: cython.bint, terms: TermTorques
    ) -> cython.void:
        """Start a step at the present state of both legs. brush: the swing foot's sole may touch the floor."""
        self.s = s
        self.w = w
        self.double_stance = double_stance
        self.brush = brush and not double_stance
        self.terms = terms
        s.begin(False, s.leg.C)
        w.begin(w.leg.Jf == 0.0 and not double_stance, 0.0)
        self.hip_angle = s.th - w.th

    # ---- terms that depend on angles alone ------------------------------------------------------------------

    @cython.cfunc
    def set_geometry(self, moved: cython.bint, other_foot: cython.bint) -> cython.void:
        """Chains, mass matrix and constraint at the present angles of the legs.

        moved: the sines are those of other angles; other_foot: the other foot's chain is needed without contact, too.
        """
        s: LegMotion = self.s
        w: LegMotion = self.w
        other_foot = other_foot or self.double_stance or self.brush
        if moved:
            s.set_foot_sines()
            s.set_leg_sines()
            w.set_leg_sines()
            if other_foot:
                w.set_foot_sines()
        s.set_chain()
        w.set_first_moments()
        self.set_mass_matrix()
        self.eliminate_other_leg()
        if other_foot:
            w.set_chain()
            self.gap = (s.leg.height - w.leg.height) + (s.e - w.e) + (s.l_cos - w.l_cos)
        if self.double_stance:
            self.set_constraint()

    @cython.cfunc
    def set_mass_matrix(self) -> cython.void:
        """EQUATIONS 5.1 (U, V), 5.2 (S) and 5.3 (m); m22 and 1 / m33 are constants of the legs."""
        s: LegMotion = self.s
        w: LegMotion = self.w
        leg: Leg = s.leg
        self.U = leg.mt * s.cos_leg - leg.mw * s.sin_leg
        self.V = leg.mt * s.sin_leg + leg.mw * s.cos_leg
        self.S = s.l_sin * w.A - s.l_cos * w.B
        self.m11 = self.M * (s.e * s.e + s.f * s.f) + leg.Jf
        self.m12 = self.U * s.e - self.V * s.f
        self.m13 = w.B * s.f - w.A * s.e
        self.m23 = -(s.l_cos * w.A + s.l_sin * w.B) - self.hip.J

    @cython.cfunc
    def eliminate_other_leg(self) -> cython.void:
        """The third equation of 5.3 put into the others: n is the inverse of what is left of m."""
        i33: cython.double = self.w.leg.i33
        self.w1 = self.m13 * i33
        self.w2 = self.m23 * i33
        n11: cython.double = self.m11 - self.w1 * self.m13
        n12: cython.double = self.m12 - self.w1 * self.m23
        n22: cython.double = self.s.leg.m22 - self.w2 * self.m23
        inverse: cython.double = 1.0 / (n11 * n22 - n12 * n12)
        self.n11 = n11 * inverse
        self.n12 = n12 * inverse
        self.n22 = n22 * inverse

    @cython.cfunc
    def solve(self, Q: cython.p_double, dd: cython.p_double) -> cython.void:
        """Accelerations `dd` that the generalised forces `Q` cause: m dd = Q."""
        b1: cython.double = Q[0] - self.w1 * Q[2]
        b2: cython.double = Q[1] - self.w2 * Q[2]
        dd[0] = self.n22 * b1 - self.n12 * b2
        dd[1] = self.n11 * b2 - self.n12 * b1
        dd[2] = self.w.leg.i33 * Q[2] - self.w1 * dd[0] - self.w2 * dd[1]

    # ---- torques and forces ---------------------------------------------------------------------------------

    @cython.cfunc
    def set_applied_torques(self) -> cython.void:
        """EQUATIONS 2 and 12: hip and ankles."""
        s: LegMotion = self.s
        w: LegMotion = self.w
        sign: cython.double = s.leg.hip_sign
        rate: cython.double = s.dth - w.dth
        self.T_h = self.hip.torque(sign, self.hip_angle, rate, self.per_rad_s)
        if self.terms is not None:
            self.T_h += sign * self.terms.torque_on_hip(sign * self.hip_angle, sign * rate)
        s.set_torques(self.ankle, self.terms, self.per_rad_s)
        w.set_torques(self.ankle, self.terms, self.per_rad_s)

    @cython.cfunc
    def set_velocity_terms_and_gravity(self) -> cython.void:
        """EQUATIONS 5.2: (ax, ay) of the ankle and (Px, Py), without angular accelerations and less gravity."""
        s: LegMotion = self.s
        w: LegMotion = self.w
        foot_square: cython.double = s.dF * s.dF
        s_square: cython.double = s.dth * s.dth
        w_square: cython.double = w.dth * w.dth
        self.ax = s.f * foot_square - self.gx
        self.ay = s.df_dF * foot_square - self.gy
        self.Px = self.M * self.ax - self.V * s_square + w.B * w_square
        self.Py = self.M * self.ay - self.U * s_square + w.A * w_square

    @cython.cfunc
    def set_generalised_forces(self) -> cython.void:
        """EQUATIONS 5.3: Q1 to Q3."""
        s: LegMotion = self.s
        w: LegMotion = self.w
        Q: cython.p_double = self.Q
        Q[0] = s.T_foot - s.e * self.Px - s.f * self.Py
        Q[1] = self.T_h - s.T - self.U * self.ax + self.V * self.ay + self.S * (w.dth * w.dth)
        Q[2] = w.A * self.ax - w.B * self.ay - self.S * (s.dth * s.dth) - self.T_h - w.T

    @cython.cfunc
    def add_brush(self) -> cython.void:
        """EQUATIONS 9: the swing foot brushes the floor with its sole, normal force and sliding friction."""
        s: LegMotion = self.s
        w: LegMotion = self.w
        sole: Sole = self.sole
        Q: cython.p_double = self.Q
        torque: cython.double
        self.Ry = -sole.k * self.gap - sole.c * self.rate_y()
        if self.Ry <= 0.0:
            self.Ry = 0.0
            return
        self.Rx = -sole.mu * self.Ry * smoothed_sign(self.rate_x() * sole.per_m_s)
        torque = -w.e * self.Rx - w.f * self.Ry
        Q[0] += s.e * self.Rx + s.f * self.Ry
        Q[1] += s.l_cos * self.Rx - s.l_sin * self.Ry
        Q[2] += w.l_sin * self.Ry - w.l_cos * self.Rx
        w.T_foot += torque
        if w.massless:
            Q[2] += torque
            w.T_motor += torque

    @cython.cfunc
    @cython.exceptval(check=False)
    def rate_x(self) -> cython.double:
        """Rate of the other foot's contact along the floor, m/s (EQUATIONS 4, of both chains)."""
        s: LegMotion = self.s
        w: LegMotion = self.w
        return s.e * s.dF + s.l_cos * s.dth - w.e * w.dF - w.l_cos * w.dth

    @cython.cfunc
    @cython.exceptval(check=False)
    def rate_y(self) -> cython.double:
        """Rate of `gap`, m/s (EQUATIONS 4, of both chains)."""
        s: LegMotion = self.s
        w: LegMotion = self.w
        return s.f * s.dF - s.l_sin * s.dth - w.f * w.dF + w.l_sin * w.dth

    # ---- the closed linkage of double stance ----------------------------------------------------------------

    @cython.cfunc
    def set_constraint(self) -> cython.void:
        """EQUATIONS 6: rows J, columns m^-1 J^T, and the adjugate c of the matrix of (Rx, Ry, ddF_w)."""
        s: LegMotion = self.s
        w: LegMotion = self.w
        Jf: cython.double = w.leg.Jf
        r: cython.double = s.leg.r
        rolled: cython.double = r * ((s.F - s.sigma) - (w.F - w.sigma)) + (r - w.leg.r) * (w.F - w.sigma)
        # r (F - sigma) - f + l sin th of both legs; with equal feet the rolled way is one product
        self.gap_x = (s.leg.anchor - w.leg.anchor) + rolled - (s.f - w.f) + (s.l_sin - w.l_sin)
        self.Jx[0] = s.e
        self.Jx[1] = s.l_cos
        self.Jx[2] = -w.l_cos
        self.Jy[0] = s.f
        self.Jy[1] = -s.l_sin
        self.Jy[2] = w.l_sin
        self.solve(self.Jx, self.MJx)
        self.solve(self.Jy, self.MJy)
        Nxx: cython.double = product(self.Jx, self.MJx)
        Nxy: cython.double = product(self.Jx, self.MJy)
        Nyy: cython.double = product(self.Jy, self.MJy)
        self.c11 = -Nyy * Jf - w.f * w.f
        self.c12 = w.e * w.f + Nxy * Jf
        self.c13 = w.e * Nyy - Nxy * w.f
        self.c22 = -Nxx * Jf - w.e * w.e
        self.c23 = Nxx * w.f - Nxy * w.e
        self.c33 = Nxx * Nyy - Nxy * Nxy
        self.inverse_determinant = 1.0 / (Nxx * self.c11 + Nxy * self.c12 - w.e * self.c13)

    @cython.cfunc
    @cython.exceptval(check=False)
    def close_linkage(self) -> cython.double:
        """EQUATIONS 6: the other foot closes the linkage by its force (Rx, Ry). Returns ddF_w."""
        s: LegMotion = self.s
        w: LegMotion = self.w
        om: cython.double = self.closing_rate
        F2: cython.double = s.dF * s.dF
        th2: cython.double = s.dth * s.dth
        w_th2: cython.double = w.dth * w.dth
        w_F2: cython.double = w.dF * w.dF
        # c: difference of the chains' biases, and what pulls errors in
        x: cython.double = w.f * w_F2 - w.l_sin * w_th2 - s.f * F2 + s.l_sin * th2
        y: cython.double = w.df_dF * w_F2 - w.l_cos * w_th2 - s.df_dF * F2 + s.l_cos * th2
        x -= om * (2.0 * self.rate_x() + om * self.gap_x)
        y -= om * (2.0 * self.rate_y() + om * self.gap)
        w.T_foot -= w.leg.C * w.dF  # EQUATIONS 2.6
        x -= product(self.Jx, self.dd)
        y -= product(self.Jy, self.dd)
        T: cython.double = -w.T_foot
        i: cython.Py_ssize_t
        self.Rx = (self.c11 * x + self.c12 * y + self.c13 * T) * self.inverse_determinant
        self.Ry = (self.c12 * x + self.c22 * y + self.c23 * T) * self.inverse_determinant
        for i in range(3):
            self.dd[i] += self.MJx[i] * self.Rx + self.MJy[i] * self.Ry
        return (self.c13 * x + self.c23 * y + self.c33 * T) * self.inverse_determinant

    # ---- accelerations and forces ---------------------------------------------------------------------------

    @cython.cfunc
    def accelerate(self, stage: cython.longlong) -> cython.void:
        """Accelerations at this stage, into both legs."""
        s: LegMotion = self.s
        w: LegMotion = self.w
        inverse_J: cython.double = self.ankle.inverse_J
        self.Rx = 0.0
        self.Ry = 0.0
        self.set_applied_torques()
        self.set_velocity_terms_and_gravity()
        self.set_generalised_forces()
        if self.brush and self.gap < 0.0:
            self.add_brush()
        self.solve(self.Q, self.dd)
        s.ddp[stage] = s.T_motor * inverse_J
        w.ddp[stage] = w.T_motor * inverse_J
        if self.double_stance:
            w.ddF[stage] = self.close_linkage()
        s.ddF[stage] = self.dd[0]
        s.ddth[stage] = self.dd[1]
        w.ddth[stage] = self.dd[2]
        if not self.double_stance:
            w.set_free_foot(stage)

    @cython.cfunc
    def set_floor_forces(self) -> cython.void:
        """EQUATIONS 5.3: on the stance foot the rate of the whole momentum less gravity and the other foot's force."""
        s: LegMotion = self.s
        w: LegMotion = self.w
        M: cython.double = self.M
        dd: cython.p_double = self.dd
        s.leg.Fx = self.Px + (M * s.e * dd[0] + self.U * dd[1] - w.A * dd[2] - self.Rx)
        s.leg.Fy = self.Py + (M * s.f * dd[0] - self.V * dd[1] + w.B * dd[2] - self.Ry)
        w.leg.Fx = self.Rx
        w.leg.Fy = self.Ry


@cython.cfunc
@cython.exceptval(check=False)
def product(a: cython.p_double, b: cython.p_double) -> cython.double:
    """Scalar product of two arrays of three."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
