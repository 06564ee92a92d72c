# cython: cdivision=True
# (only by masses and inertias, which are above zero)
"""Motion in the air or in the operator's hands (EQUATIONS 7); written as `on_feet` is."""

import cython
from cython.cimports.libc.math import cos, sin

from ranger_sim.plant.mechanics.body import HELD, Body
from ranger_sim.plant.mechanics.friction import smoothed_sign
from ranger_sim.plant.mechanics.leg import Leg
from ranger_sim.plant.mechanics.parts import Ankle, HipJoint
from ranger_sim.plant.mechanics.term_torques import TermTorques


@cython.ccall
@cython.exceptval(check=True)
def in_air(body: "Body", h: cython.double, stages: cython.longlong) -> cython.void:
    """One step as `on_feet` makes it, of `h` seconds in flight or held (EQUATIONS 7); stages 4, or 1 to evaluate only.

    Inside, o is the outer leg with foot F, leg th and motor p, i the inner one with foot G, leg tw and motor n; neither
    has a role, but a standing foot in the operator's hands. One long function,
    because its stages share their numbers as those of `on_feet` do.
    """
    o: Leg = body.outer
    i: Leg = body.inner
    joint: HipJoint = body.hip
    ankle: Ankle = body.ankle
    terms: TermTorques = body.terms
    held: cython.bint = body.mode == HELD
    locked: cython.bint = held and body.lock_hip
    standing: Leg = body.stance if held and body.standing else None
    with_terms: cython.bint = terms is not None
    stage: cython.longlong
    M: cython.double = body.M
    JH: cython.double = joint.J
    iJA: cython.double = ankle.inverse_J
    gx: cython.double = body.gx
    gy: cython.double = body.gy
    eps: cython.double = body.inverse_smoothing
    ks: cython.double = ankle.k
    return_k: cython.double = ankle.return_k
    F: cython.double = o.foot_angle
    th: cython.double = o.angle
    tw: cython.double = i.angle
    G: cython.double = i.foot_angle
    p: cython.double = o.motor_angle
    n: cython.double = i.motor_angle
    uF: cython.double = o.foot_rate
    us: cython.double = o.rate
    uw: cython.double = i.rate
    uG: cython.double = i.foot_rate
    up: cython.double = o.motor_rate
    un: cython.double = i.motor_rate
    F0, th0, tw0, G0, p0, n0 = F, th, tw, G, p, n
    uF0, us0, uw0, uG0, up0, un0 = uF, us, uw, uG, up, un
    body.know_angles()
    st, ct, sw, cw = o.sin_leg, o.cos_leg, i.sin_leg, i.cos_leg
    hands: cython.double = 2.0  # N m s/rad, damping by the operator's hands (EQUATIONS 7.2)
    if standing is not None:
        sS, cS, rolling = standing.sin_foot, standing.cos_foot, standing.C + hands
    half: cython.double = 0.5 * h
    quarter: cython.double = 0.25 * h
    # parts at rest while the operator holds the robot
    as_ = aw = axh = ayh = 0.0
    for stage in range(stages):
        if stage != 2:
            # terms that depend on angles alone; stages 1 and 2 have the same angles
            a_s = F - th
            a_w = G - tw
            pull_s = 0.0 if o.Jf == 0.0 and standing is not o else ks * (p - a_s)
            pull_w = 0.0 if i.Jf == 0.0 and standing is not i else ks * (n - a_w)
            if not locked:
                if stage > 0:
                    st = sin(th)
                    ct = cos(th)
                    sw = sin(tw)
                    cw = cos(tw)
                Ao = o.mc * ct + o.mw * st
                Bo = o.mc * st - o.mw * ct
                Ai = i.mc * cw + i.mw * sw
                Bi = i.mc * sw - i.mw * cw
                spring = joint.spring_torque(th - tw)
            if standing is not None:
                # the stance foot rolls under the weight, the legs keep their lean (EQUATIONS 7.2)
                foot = F if standing is o else G
                if stage > 0:
                    sS = sin(foot)
                    cS = cos(foot)
                e = standing.r - standing.d * cS
                f = standing.d * sS
                if foot < standing.heel or foot > standing.toe:
                    e = standing.r * cos(standing.excess(foot)) - standing.d * cS
                    f -= standing.r * sin(standing.excess(foot))
                push = M * (e * gx + f * gy)
                weight_J = M * (e * e + f * f) + standing.Jf
        Ts = pull_s
        Tw = pull_w
        mp = o.drive - o.coulomb * smoothed_sign(up * eps) - o.viscous * up - Ts
        mn = i.drive - i.coulomb * smoothed_sign(un * eps) - i.viscous * un - Tw
        if return_k != 0.0:
            # EQUATIONS 2.7: springs that return the foot
            back = return_k * (a_s - ankle.rest)
            if o.Jf == 0.0 and standing is not o:
                mp -= back  # the cable transmits it
            else:
                Ts -= back
            back = return_k * (a_w - ankle.rest)
            if i.Jf == 0.0 and standing is not i:
                mn -= back
            else:
                Tw -= back
        if a_s < ankle.low or a_s > ankle.high:
            stop = ankle.stop_torque(a_s, uF - us)
            if o.Jf == 0.0 and standing is not o:
                mp += stop
            else:
                Ts += stop
        if a_w < ankle.low or a_w > ankle.high:
            stop = ankle.stop_torque(a_w, uG - uw)
            if i.Jf == 0.0 and standing is not i:
                mn += stop
            else:
                Tw += stop
        hd = us - uw
        Th = 0.0
        if not locked:
            Th = joint.drive - joint.coulomb * smoothed_sign(hd * eps) - joint.viscous * hd - spring
        if with_terms:
            Th += terms.torque_on_hip(th - tw, hd)
            terms.act_on_ankle(o, a_s, uF - us, p, up)
            terms.act_on_ankle(i, a_w, uG - uw, n, un)
            mp += o.extra_motor
            mn += i.extra_motor
            if o.Jf == 0.0 and standing is not o:
                mp += o.extra_ankle
            else:
                Ts += o.extra_ankle
            if i.Jf == 0.0 and standing is not i:
                mn += i.extra_ankle
            else:
                Tw += i.extra_ankle
        ap = mp * iJA
        an = mn * iJA
        if not held:
            # eliminate the hip's acceleration less gravity (EQUATIONS 7.1)
            bx = -(Bo * us * us + Bi * uw * uw) / M
            by = -(Ao * us * us + Ai * uw * uw) / M
            n11 = o.J + JH - (Ao * Ao + Bo * Bo) / M
            n22 = i.J + JH - (Ai * Ai + Bi * Bi) / M
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
            aw = (-Th - Tw - Ai * gx + Bi * gy) / (i.J + JH)
        aF = as_ + ap if o.Jf == 0.0 else Ts * o.inverse_Jf
        aG = aw + an if i.Jf == 0.0 else Tw * i.inverse_Jf
        if standing is o:
            aF = (Ts - rolling * uF + push) / weight_J
        elif standing is i:
            aG = (Tw - rolling * uG + push) / weight_J
        if stage == 0:
            o.foot_acc = aF
            o.acc = as_
            i.acc = aw
            i.foot_acc = aG
            o.motor_acc = ap
            i.motor_acc = an
            body.hip_ay = ayh
            o.Fx = o.Fy = i.Fx = i.Fy = 0.0
            if standing is not None:
                standing.Fx = -M * gx
                standing.Fy = -M * gy
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
    o.foot_angle = F0 + h * (uF0 + sixth * qF)
    o.angle = th0 + h * (us0 + sixth * qs)
    i.angle = tw0 + h * (uw0 + sixth * qw)
    i.foot_angle = G0 + h * (uG0 + sixth * qG)
    o.motor_angle = p0 + h * (up0 + sixth * qp)
    i.motor_angle = n0 + h * (un0 + sixth * qn)
    o.foot_rate = uF0 + sixth * (vF + aF)
    o.rate = us0 + sixth * (vs + as_)
    i.rate = uw0 + sixth * (vw + aw)
    i.foot_rate = uG0 + sixth * (vG + aG)
    o.motor_rate = up0 + sixth * (vp + ap)
    i.motor_rate = un0 + sixth * (vn + an)
    if not held:
        body.hip_x += h * (body.hip_vx + sixth * qx)
        body.hip_y += h * (body.hip_vy + sixth * qy)
        body.hip_vx += sixth * (vx + axh)
        body.hip_vy += sixth * (vy + ayh)
