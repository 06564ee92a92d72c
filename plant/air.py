# cython: cdivision=True
# (only by masses and inertias, which are above zero)
"""Motion in the air or in the operator's hands (EQUATIONS 7); written as `on_feet` is."""

import cython

if not cython.compiled:
    from math import cos, sin

    from ranger_sim.plant.friction import smoothed_sign


def in_air(body, h: cython.double, stages: cython.longlong) -> cython.void:
    """One step as `on_feet` makes it, of `h` seconds in flight or held (EQUATIONS 7); stages 4, or 1 to look."""
    held: cython.bint = body.mode == 0
    locked: cython.bint = held and body.lock_hip
    standing: cython.bint = held and body.standing
    outer_stands: cython.bint = standing and body.stance == 0
    inner_stands: cython.bint = standing and body.stance == 1
    massless: cython.bint = body.Jf == 0.0
    with_terms: cython.bint = body.terms is not None
    stage: cython.longlong
    M: cython.double = body.M
    JH: cython.double = body.JH
    iJA: cython.double = body.inverse_JA
    iJf: cython.double = body.inverse_Jf
    gx: cython.double = body.gx
    gy: cython.double = body.gy
    r: cython.double = body.r
    d: cython.double = body.d
    eps: cython.double = body.inverse_smoothing
    mco: cython.double = body.mc_outer
    mwo: cython.double = body.mw_outer
    mci: cython.double = body.mc_inner
    mwi: cython.double = body.mw_inner
    ks: cython.double = body.ks
    low: cython.double = body.stop_low
    high: cython.double = body.stop_high
    F: cython.double = body.foot_outer
    th: cython.double = body.leg_outer
    tw: cython.double = body.leg_inner
    G: cython.double = body.foot_inner
    p: cython.double = body.motor_outer
    n: cython.double = body.motor_inner
    uF: cython.double = body.foot_outer_rate
    us: cython.double = body.leg_outer_rate
    uw: cython.double = body.leg_inner_rate
    uG: cython.double = body.foot_inner_rate
    up: cython.double = body.motor_outer_rate
    un: cython.double = body.motor_inner_rate
    o_drive, o_coulomb, o_viscous = body.outer_drive, body.outer_coulomb, body.outer_viscous
    i_drive, i_coulomb, i_viscous = body.inner_drive, body.inner_coulomb, body.inner_viscous
    hip_drive, hip_coulomb, hip_viscous = body.hip_drive, body.hip_coulomb, body.hip_viscous
    exact_spring: cython.bint = body.exact_spring
    kh: cython.double = body.kh
    F0, th0, tw0, G0, p0, n0 = F, th, tw, G, p, n
    uF0, us0, uw0, uG0, up0, un0 = uF, us, uw, uG, up, un
    body.know_angles()
    st, ct, sw, cw = body.sin_leg_outer, body.cos_leg_outer, body.sin_leg_inner, body.cos_leg_inner
    if outer_stands:
        sS, cS, rolling = body.sin_foot_outer, body.cos_foot_outer, body.C_outer + 2.0
    else:
        sS, cS, rolling = body.sin_foot_inner, body.cos_foot_inner, body.C_inner + 2.0
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
                spring = body.spring_torque(th - tw) if exact_spring else kh * (th - tw)
            if standing:
                # the stance foot rolls under the weight, the legs keep their lean (EQUATIONS 7.2)
                foot = F if outer_stands else G
                if stage > 0:
                    sS = sin(foot)
                    cS = cos(foot)
                e = r - d * cS
                f = d * sS
                if foot < body.heel or foot > body.toe:
                    e = r * cos(body.excess(foot)) - d * cS
                    f -= r * sin(body.excess(foot))
                push = M * (e * gx + f * gy)
                weight_J = M * (e * e + f * f) + body.Jf
        Ts = pull_s
        Tw = pull_w
        mp = o_drive - o_coulomb * smoothed_sign(up * eps) - o_viscous * up - Ts
        mn = i_drive - i_coulomb * smoothed_sign(un * eps) - i_viscous * un - Tw
        if a_s < low or a_s > high:
            stop = body.stop_torque(a_s, uF - us)
            Ts += stop
            if massless:
                mp += stop
        if a_w < low or a_w > high:
            stop = body.stop_torque(a_w, uG - uw)
            Tw += stop
            if massless:
                mn += stop
        hd = us - uw
        Th = 0.0
        if not locked:
            Th = hip_drive - hip_coulomb * smoothed_sign(hd * eps) - hip_viscous * hd - spring
        if with_terms:
            body.ask_terms(True, th - tw, a_s, a_w, p, n, hd, uF - us, uG - uw, up, un)
            Th += body.extra_hip
            Ts += body.extra_outer
            Tw += body.extra_inner
            mp += body.extra_outer_motor
            mn += body.extra_inner_motor
            if massless:
                mp += body.extra_outer
                mn += body.extra_inner
        ap = mp * iJA
        an = mn * iJA
        if not held:
            # eliminate the hip's acceleration less gravity (EQUATIONS 7.1)
            bx = -(Bo * us * us + Bi * uw * uw) / M
            by = -(Ao * us * us + Ai * uw * uw) / M
            n11 = body.J_outer + JH - (Ao * Ao + Bo * Bo) / M
            n22 = body.J_inner + JH - (Ai * Ai + Bi * Bi) / M
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
            aw = (-Th - Tw - Ai * gx + Bi * gy) / (body.J_inner + JH)
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
            body.foot_outer_acc = aF
            body.leg_outer_acc = as_
            body.leg_inner_acc = aw
            body.foot_inner_acc = aG
            body.motor_outer_acc = ap
            body.motor_inner_acc = an
            body.hip_ay = ayh
            body.outer_Fx = -M * gx if outer_stands else 0.0
            body.outer_Fy = -M * gy if outer_stands else 0.0
            body.inner_Fx = -M * gx if inner_stands else 0.0
            body.inner_Fy = -M * gy if inner_stands else 0.0
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
    body.foot_outer = F0 + h * (uF0 + sixth * qF)
    body.leg_outer = th0 + h * (us0 + sixth * qs)
    body.leg_inner = tw0 + h * (uw0 + sixth * qw)
    body.foot_inner = G0 + h * (uG0 + sixth * qG)
    body.motor_outer = p0 + h * (up0 + sixth * qp)
    body.motor_inner = n0 + h * (un0 + sixth * qn)
    body.foot_outer_rate = uF0 + sixth * (vF + aF)
    body.leg_outer_rate = us0 + sixth * (vs + as_)
    body.leg_inner_rate = uw0 + sixth * (vw + aw)
    body.foot_inner_rate = uG0 + sixth * (vG + aG)
    body.motor_outer_rate = up0 + sixth * (vp + ap)
    body.motor_inner_rate = un0 + sixth * (vn + an)
    if not held:
        body.hip_x += h * (body.hip_vx + sixth * qx)
        body.hip_y += h * (body.hip_vy + sixth * qy)
        body.hip_vx += sixth * (vx + axh)
        body.hip_vy += sixth * (vy + ayh)
