# cython: cdivision=True
# (only by masses and inertias, which are above zero)
"""A step in the air or in the operator's hands (EQUATIONS 7, 15)."""

import cython

from ranger_sim.plant.mechanics.body import HELD, Body
from ranger_sim.plant.mechanics.leg import Leg
from ranger_sim.plant.mechanics.leg_motion import LegMotion, next_angle, weighted_sum
from ranger_sim.plant.mechanics.parts import HipJoint
from ranger_sim.plant.mechanics.term_torques import TermTorques


@cython.ccall
@cython.exceptval(check=True)
def in_air(body: "Body", h: cython.double, stages: cython.longlong) -> cython.void:
    """One step as `on_feet` makes it, of `h` seconds in flight or held (EQUATIONS 7); stages 4, or 1 to evaluate only.

    Accelerations of the start of the step are left in the legs, and with stages 4 the state of its end.
    """
    o: LegMotion = body.outer_motion
    i: LegMotion = body.inner_motion
    held: cython.bint = body.mode == HELD
    standing: Leg = body.stance if held and body.standing else None
    half: cython.double = 0.5 * h
    body.know_angles()
    o.begin(o.leg.Jf == 0.0 and o.leg is not standing, 0.0)
    i.begin(i.leg.Jf == 0.0 and i.leg is not standing, 0.0)
    accelerate(body, 0)
    o.keep_accelerations()
    i.keep_accelerations()
    body.hip_ay = body.hip_ddy[0]
    body.outer.Fx = body.outer.Fy = body.inner.Fx = body.inner.Fy = 0.0
    if standing is not None:
        standing.Fx = -body.M * body.gx
        standing.Fy = -body.M * body.gy
    if stages == 1:
        return
    o.go_to_middle(h)
    i.go_to_middle(h)
    accelerate(body, 1)
    o.set_rates(1, half)
    i.set_rates(1, half)
    accelerate(body, 2)
    o.go_to_end(h)
    i.go_to_end(h)
    accelerate(body, 3)
    o.finish(h, False)
    i.finish(h, False)
    if not held:
        body.hip_x = next_angle(body.hip_x, body.hip_vx, body.hip_ddx, h)
        body.hip_y = next_angle(body.hip_y, body.hip_vy, body.hip_ddy, h)
        body.hip_vx += h / 6.0 * weighted_sum(body.hip_ddx, False)
        body.hip_vy += h / 6.0 * weighted_sum(body.hip_ddy, False)


@cython.cfunc
def accelerate(body: "Body", stage: cython.longlong) -> cython.void:
    """Accelerations at this stage, into the legs and `hip_ddx`, `hip_ddy` of the body."""
    o: LegMotion = body.outer_motion
    i: LegMotion = body.inner_motion
    hip: HipJoint = body.hip
    terms: TermTorques = body.terms
    T_h: cython.double
    # parts at rest while the operator holds the robot
    o.ddth[stage] = i.ddth[stage] = body.hip_ddx[stage] = body.hip_ddy[stage] = 0.0
    o.set_torques(body.ankle, terms, body.inverse_smoothing)
    i.set_torques(body.ankle, terms, body.inverse_smoothing)
    o.ddp[stage] = o.T_motor * body.ankle.inverse_J
    i.ddp[stage] = i.T_motor * body.ankle.inverse_J
    if body.mode != HELD or not body.lock_hip:
        if stage > 0:
            o.set_leg_sines()
            i.set_leg_sines()
        T_h = hip.torque(1.0, o.th - i.th, o.dth - i.dth, body.inverse_smoothing)
        if terms is not None:
            T_h += terms.torque_on_hip(o.th - i.th, o.dth - i.dth)
        i.set_first_moments()
        if body.mode == HELD:
            # EQUATIONS 7.2: the hip rests: gravity as if the hip were accelerated by its opposite
            i.ddth[stage] = (-T_h - i.T - i.A * body.gx + i.B * body.gy) / (i.leg.J + hip.J)
        else:
            o.set_first_moments()
            fly(body, T_h, stage)
    o.set_free_foot(stage)
    i.set_free_foot(stage)
    if body.mode == HELD and body.standing:
        roll_in_hands(body, o if body.stance is body.outer else i, stage)


@cython.cfunc
def fly(body: "Body", T_h: cython.double, stage: cython.longlong) -> cython.void:
    """EQUATIONS 7.1: eliminate the hip's acceleration less gravity (bx, by), and solve for both legs."""
    o: LegMotion = body.outer_motion
    i: LegMotion = body.inner_motion
    M: cython.double = body.M
    J_h: cython.double = body.hip.J
    bx: cython.double = -(o.B * o.dth * o.dth + i.B * i.dth * i.dth) / M
    by: cython.double = -(o.A * o.dth * o.dth + i.A * i.dth * i.dth) / M
    m11: cython.double = o.leg.J + J_h - (o.A * o.A + o.B * o.B) / M
    m22: cython.double = i.leg.J + J_h - (i.A * i.A + i.B * i.B) / M
    m12: cython.double = -J_h - (o.A * i.A + o.B * i.B) / M
    Q1: cython.double = T_h - o.T + o.A * bx - o.B * by
    Q2: cython.double = -T_h - i.T + i.A * bx - i.B * by
    inverse: cython.double = 1.0 / (m11 * m22 - m12 * m12)
    o.ddth[stage] = (m22 * Q1 - m12 * Q2) * inverse
    i.ddth[stage] = (m11 * Q2 - m12 * Q1) * inverse
    body.hip_ddx[stage] = bx + (o.A * o.ddth[stage] + i.A * i.ddth[stage]) / M + body.gx
    body.hip_ddy[stage] = by - (o.B * o.ddth[stage] + i.B * i.ddth[stage]) / M + body.gy


@cython.cfunc
def roll_in_hands(body: "Body", standing: LegMotion, stage: cython.longlong) -> cython.void:
    """EQUATIONS 7.2: the stance foot rolls under the weight, the legs keep their lean."""
    M: cython.double = body.M
    hands: cython.double = 2.0  # N m s/rad, damping by the operator's hands (EQUATIONS 7.2)
    weight: cython.double
    inertia: cython.double
    if stage > 0:
        standing.set_foot_sines()
    standing.set_chain()
    weight = M * (standing.e * body.gx + standing.f * body.gy)
    inertia = M * (standing.e * standing.e + standing.f * standing.f) + standing.leg.Jf
    standing.ddF[stage] = (standing.T_foot - (standing.leg.C + hands) * standing.dF + weight) / inertia
