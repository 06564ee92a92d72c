# cython: cdivision=True
# (only by determinants of inertia, which are above zero)
"""Motion on one or two feet (EQUATIONS 5, 6).

One function from the state to the state after a step: its stages share some sixty numbers, and to hand these from one
function to the next would cost more than to work them out. It reads in paragraphs: the state by the roles of the legs;
in every stage the motors, what depends on angles alone, torques and forces, accelerations, the next stage's state; then
the step's end, back in fixed legs.
"""

import cython

if not cython.compiled:
    from math import cos, sin

    from ranger_sim.plant.friction import smoothed_sign


def on_feet(body, h: cython.double, stages: cython.longlong) -> cython.void:
    """One Runge-Kutta-Nystrom step of `h` seconds in single or double stance; stages 4, or 1 to look only.

    Inside, s is the stance (reference) leg and w the other. Accelerations and floor forces of the start of
    the step are left in the fields (EQUATIONS 5, 6); the stages' angles and rates are those of EQUATIONS 15.
    The pose of the end, hip and gaps, is left there too.
    """
    double_stance: cython.bint = body.mode == 2
    outer_stance: cython.bint = body.stance == 0
    massless: cython.bint = body.Jf == 0.0 and not double_stance
    brush: cython.bint = body.brush and not double_stance
    with_terms: cython.bint = body.terms is not None
    exact_spring: cython.bint = body.exact_spring
    stage: cython.longlong
    M: cython.double = body.M
    el: cython.double = body.el
    r: cython.double = body.r
    d: cython.double = body.d
    gx: cython.double = body.gx
    gy: cython.double = body.gy
    kh: cython.double = body.kh
    ks: cython.double = body.ks
    Jf: cython.double = body.Jf
    JH: cython.double = body.JH
    iJA: cython.double = body.inverse_JA
    iJf: cython.double = body.inverse_Jf
    heel: cython.double = body.heel
    toe: cython.double = body.toe
    low: cython.double = body.stop_low
    high: cython.double = body.stop_high
    eps: cython.double = body.inverse_smoothing
    hip_coulomb: cython.double = body.hip_coulomb
    hip_viscous: cython.double = body.hip_viscous
    # the state, by role
    body.know_angles()
    if outer_stance:
        F0, th0, tw0, G0 = body.foot_outer, body.leg_outer, body.leg_inner, body.foot_inner
        p0, n0 = body.motor_outer, body.motor_inner
        uF0, us0, uw0, uG0 = (
            body.foot_outer_rate,
            body.leg_outer_rate,
            body.leg_inner_rate,
            body.foot_inner_rate,
        )
        up0, un0 = body.motor_outer_rate, body.motor_inner_rate
        sF, cF, st, ct = body.sin_foot_outer, body.cos_foot_outer, body.sin_leg_outer, body.cos_leg_outer
        sw, cw, sG, cG = body.sin_leg_inner, body.cos_leg_inner, body.sin_foot_inner, body.cos_foot_inner
        mts, mws, mcw, mww = body.mt_outer, body.mw_outer, body.mc_inner, body.mw_inner
        m22, i33, Cs, Cw = body.m22_outer, body.i33_inner, body.C_outer, body.C_inner
        hip_drive = body.hip_drive
        s_drive, s_coulomb, s_viscous = body.outer_drive, body.outer_coulomb, body.outer_viscous
        w_drive, w_coulomb, w_viscous = body.inner_drive, body.inner_coulomb, body.inner_viscous
        Xs, Xw, Ys, Yw = body.anchor_outer, body.anchor_inner, body.height_outer, body.height_inner
    else:
        F0, th0, tw0, G0 = body.foot_inner, body.leg_inner, body.leg_outer, body.foot_outer
        p0, n0 = body.motor_inner, body.motor_outer
        uF0, us0, uw0, uG0 = (
            body.foot_inner_rate,
            body.leg_inner_rate,
            body.leg_outer_rate,
            body.foot_outer_rate,
        )
        up0, un0 = body.motor_inner_rate, body.motor_outer_rate
        sF, cF, st, ct = body.sin_foot_inner, body.cos_foot_inner, body.sin_leg_inner, body.cos_leg_inner
        sw, cw, sG, cG = body.sin_leg_outer, body.cos_leg_outer, body.sin_foot_outer, body.cos_foot_outer
        mts, mws, mcw, mww = body.mt_inner, body.mw_inner, body.mc_outer, body.mw_outer
        m22, i33, Cs, Cw = body.m22_inner, body.i33_outer, body.C_inner, body.C_outer
        hip_drive = -body.hip_drive
        s_drive, s_coulomb, s_viscous = body.inner_drive, body.inner_coulomb, body.inner_viscous
        w_drive, w_coulomb, w_viscous = body.outer_drive, body.outer_coulomb, body.outer_viscous
        Xs, Xw, Ys, Yw = body.anchor_inner, body.anchor_outer, body.height_inner, body.height_outer
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
            # the standing chain and the mass matrix, its inverse n from two rows (EQUATIONS 4, 5.1, 5.3)
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
            # cables and hip spring (EQUATIONS 2.3, 2.4)
            pull_s = ks * (p - a_s)
            pull_w = 0.0 if massless else ks * (n - a_w)
            spring = body.spring_torque(hip) if exact_spring else kh * hip
            if brush or double_stance or stage == 3:
                # the other foot's chain, and its height above the floor
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
            Ts += body.stop_torque(a_s, uF - us)
        if a_w < low or a_w > high:
            stop = body.stop_torque(a_w, uG - uw)
            Tw += stop
            if massless:
                mn += stop
        TF = Ts - Cs * uF
        TG = Tw
        if with_terms:
            body.ask_terms(outer_stance, hip, a_s, a_w, p, n, hd, uF - us, uG - uw, up, un)
            if outer_stance:
                Th += body.extra_hip
                mp += body.extra_outer_motor
                mn += body.extra_inner_motor
                extra_s, extra_w = body.extra_outer, body.extra_inner
            else:
                Th -= body.extra_hip
                mp += body.extra_inner_motor
                mn += body.extra_outer_motor
                extra_s, extra_w = body.extra_inner, body.extra_outer
            Ts += extra_s
            TF += extra_s
            Tw += extra_w
            TG += extra_w
            if massless:
                mn += extra_w
        # generalised forces on foot s, leg s, leg w (EQUATIONS 5.3)
        Q1 = TF - e * Px - f * Py
        Q2 = Th - Ts - Us * ax + Vs * ay + swing * uw2
        Q3 = Aw * ax - Bw * ay - swing * us2 - Th - Tw
        Rx = 0.0
        Ry = 0.0
        if brush and gap < 0.0:
            # the swing foot brushes the floor with its sole: normal force and sliding friction (EQUATIONS 9)
            Ry = -body.sole_k * gap - body.sole_c * (f * uF - ls * us - fw * uG + lsw * uw)
            if Ry > 0.0:
                Rx = -body.mu * Ry * smoothed_sign((e * uF + lc * us - ew * uG - lcw * uw) * body.sole_v)
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
        # accelerations
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
            om = body.closing_rate
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
                body.outer_Fx = Px
                body.outer_Fy = Py
                body.inner_Fx = Rx
                body.inner_Fy = Ry
                body.foot_outer_acc = aF
                body.leg_outer_acc = as_
                body.leg_inner_acc = aw
                body.foot_inner_acc = aG
                body.motor_outer_acc = ap
                body.motor_inner_acc = an
            else:
                body.inner_Fx = Px
                body.inner_Fy = Py
                body.outer_Fx = Rx
                body.outer_Fy = Ry
                body.foot_inner_acc = aF
                body.leg_inner_acc = as_
                body.leg_outer_acc = aw
                body.foot_outer_acc = aG
                body.motor_inner_acc = ap
                body.motor_outer_acc = an
            if stages == 1:
                return
            # the next stage (EQUATIONS 15); k: first accelerations, q: sums k1 + k2 + k3
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
    # the step's end, in fixed legs
    if outer_stance:
        body.known_foot_outer, body.known_leg_outer, body.known_leg_inner, body.known_foot_inner = F, th, tw, G
        body.sin_foot_outer, body.cos_foot_outer, body.sin_leg_outer, body.cos_leg_outer = sF, cF, st, ct
        body.sin_leg_inner, body.cos_leg_inner, body.sin_foot_inner, body.cos_foot_inner = sw, cw, sG, cG
    else:
        body.known_foot_inner, body.known_leg_inner, body.known_leg_outer, body.known_foot_outer = F, th, tw, G
        body.sin_foot_inner, body.cos_foot_inner, body.sin_leg_inner, body.cos_leg_inner = sF, cF, st, ct
        body.sin_leg_outer, body.cos_leg_outer, body.sin_foot_outer, body.cos_foot_outer = sw, cw, sG, cG
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
        body.foot_outer = F
        body.leg_outer = th
        body.leg_inner = tw
        body.foot_inner = G
        body.motor_outer = p
        body.motor_inner = n
        body.foot_outer_rate = uF
        body.leg_outer_rate = us
        body.leg_inner_rate = uw
        body.foot_inner_rate = uG
        body.motor_outer_rate = up
        body.motor_inner_rate = un
    else:
        body.foot_inner = F
        body.leg_inner = th
        body.leg_outer = tw
        body.foot_outer = G
        body.motor_inner = p
        body.motor_outer = n
        body.foot_inner_rate = uF
        body.leg_inner_rate = us
        body.leg_outer_rate = uw
        body.foot_outer_rate = uG
        body.motor_inner_rate = up
        body.motor_outer_rate = un
    if double_stance:
        body.update_pose()
        return
    # the geometry of stage 3 is that of the end: `update_pose` with what stands here (EQUATIONS 4)
    body.hip_x = Xs + r * (F - sg) - f + ls
    body.hip_y = Ys + e + lc
    if outer_stance:
        body.gap_outer = 0.0
        body.gap_inner = gap
    else:
        body.gap_outer = gap
        body.gap_inner = 0.0
