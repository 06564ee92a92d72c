# cython: cdivision=True
# (only by determinants of inertia, which are above zero)
"""Motion on one or two feet (EQUATIONS 5, 6): the right-hand side of the equations, and a step of them (15)."""

import cython
from cython.cimports.libc.math import cos, sin

from ranger_sim.plant.mechanics.body import DOUBLE, Body
from ranger_sim.plant.mechanics.friction import smoothed_sign
from ranger_sim.plant.mechanics.leg import Leg
from ranger_sim.plant.mechanics.parts import Ankle, HipJoint
from ranger_sim.plant.mechanics.term_torques import TermTorques


@cython.ccall
@cython.exceptval(check=True)
def on_feet(body: "Body", h: cython.double, stages: cython.longlong) -> cython.void:
    """One Runge-Kutta-Nystrom step of `h` seconds in single or double stance; stages 4, or 1 to evaluate only.

    Inside, s is the stance (reference) leg and w the other; numbers without a letter are those of s. Accelerations and
    floor forces of the start of the step are left in the legs (EQUATIONS 5, 6); the stages' angles and rates are those
    of EQUATIONS 15. The pose of the end, hip and gaps, is left there too.

    One long function, because its stages share some sixty numbers: passing these between functions would cost more than
    computing them. It is divided into paragraphs, each headed by its section of EQUATIONS: in every stage torques,
    terms that depend on angles alone, forces, accelerations, the next stage's state; then the step's end.
    """
    s: Leg = body.stance
    w: Leg = body.swing
    joint: HipJoint = body.hip
    ankle: Ankle = body.ankle
    terms: TermTorques = body.terms
    double_stance: cython.bint = body.mode == DOUBLE
    massless: cython.bint = w.Jf == 0.0 and not double_stance
    brush: cython.bint = body.brush and not double_stance
    with_terms: cython.bint = terms is not None
    stage: cython.longlong
    M: cython.double = body.M
    gx: cython.double = body.gx
    gy: cython.double = body.gy
    JH: cython.double = joint.J
    ks: cython.double = ankle.k
    return_k: cython.double = ankle.return_k
    iJA: cython.double = ankle.inverse_J
    eps: cython.double = body.inverse_smoothing
    # the legs: lengths, feet, masses
    el: cython.double = s.el
    r: cython.double = s.r
    d: cython.double = s.d
    Jf: cython.double = s.Jf
    mts: cython.double = s.mt
    mws: cython.double = s.mw
    m22: cython.double = s.m22
    elw: cython.double = w.el
    rw: cython.double = w.r
    dw: cython.double = w.d
    Jfw: cython.double = w.Jf
    mcw: cython.double = w.mc
    mww: cython.double = w.mw
    i33: cython.double = w.i33
    # the state: foot F, leg th, motor p of the stance leg; foot G, leg tw, motor n of the other one; u their rates
    body.know_angles()
    F0, th0, tw0, G0, p0, n0 = s.foot_angle, s.angle, w.angle, w.foot_angle, s.motor_angle, w.motor_angle
    uF0, us0, uw0, uG0, up0, un0 = s.foot_rate, s.rate, w.rate, w.foot_rate, s.motor_rate, w.motor_rate
    sF, cF, st, ct = s.sin_foot, s.cos_foot, s.sin_leg, s.cos_leg
    sw, cw, sG, cG = w.sin_leg, w.cos_leg, w.sin_foot, w.cos_foot
    # h of the hip counts from the outer to the inner legs: on the stance leg it acts with that leg's sign
    hip_sign: cython.double = s.hip_sign
    hip_drive: cython.double = hip_sign * joint.drive
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
        # EQUATIONS 2.1: motors, first of all: they are calls, and before a call everything in registers is put aside
        hd = us - uw
        mp = s.drive - s.coulomb * smoothed_sign(up * eps) - s.viscous * up
        mn = w.drive - w.coulomb * smoothed_sign(un * eps) - w.viscous * un
        Th = hip_drive - joint.coulomb * smoothed_sign(hd * eps) - joint.viscous * hd
        if stage != 2:
            # terms that depend on angles alone; stages 1 and 2 have the same angles
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
            # EQUATIONS 5.1: first moments U, V of everything about the stance ankle, A, B of the other leg
            ls = el * st
            lc = el * ct
            Us = mts * ct - mws * st
            Vs = mts * st + mws * ct
            Aw = mcw * cw + mww * sw
            Bw = mcw * sw - mww * cw
            # EQUATIONS 4: e and f of the standing chain
            df = d * cF
            f = d * sF
            sg = 0.0
            e = r - df
            if F < s.heel or F > s.toe:
                sg = F - s.heel if F < s.heel else F - s.toe
                e = r * cos(sg) - df
                f -= r * sin(sg)
                df = -e
            # EQUATIONS 5.2 (S) and 5.3: mass matrix m; n is the inverse of what is left of it without the leg w
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
            # EQUATIONS 2.3, 2.4: cables and hip spring
            pull_s = ks * (p - a_s)
            pull_w = 0.0 if massless else ks * (n - a_w)
            spring = joint.spring_torque(hip)
            if brush or double_stance or stage == 3:
                # EQUATIONS 4: the other foot's chain, and its height above the floor
                dfw = dw * cG
                fw = dw * sG
                gg = 0.0
                ew = rw - dfw
                if G < w.heel or G > w.toe:
                    gg = G - w.heel if G < w.heel else G - w.toe
                    ew = rw * cos(gg) - dfw
                    fw -= rw * sin(gg)
                    dfw = -ew
                lsw = elw * sw
                lcw = elw * cw
                gap = (s.height - w.height) + (e - ew) + (lc - lcw)
            if double_stance:
                # EQUATIONS 6: columns, what a unit force on the other foot does to the three accelerations
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
                c11 = -Syy * Jfw - fw * fw
                c12 = ew * fw + Sxy * Jfw
                c13 = ew * Syy - Sxy * fw
                c22 = -Sxx * Jfw - ew * ew
                c23 = Sxx * fw - Sxy * ew
                c33 = Sxx * Syy - Sxy * Sxy
                idet = 1.0 / (Sxx * c11 + Sxy * c12 - ew * c13)
                # r (F - sg) - f + l sin th of both legs; with equal feet the rolled way is one product
                rolled = r * ((F - sg) - (G - gg)) + (r - rw) * (G - gg)
                gap_x = (s.anchor - w.anchor) + rolled - (f - fw) + (ls - lsw)
        us2 = us * us
        uw2 = uw * uw
        uF2 = uF * uF
        # EQUATIONS 5.2: acceleration of the stance ankle without angular accelerations, less gravity
        ax = f * uF2 - gx
        ay = df * uF2 - gy
        Px = M * ax - Vs * us2 + Bw * uw2
        Py = M * ay - Us * us2 + Aw * uw2
        # EQUATIONS 2.3, 2.4, 2.5: cables with the motors behind them, hip, stops
        Ts = pull_s
        Tw = pull_w
        mp -= Ts
        mn -= Tw
        Th -= spring
        if return_k != 0.0:
            # EQUATIONS 2.7: springs that return the foot
            Ts -= return_k * (a_s - ankle.rest)
            back = return_k * (a_w - ankle.rest)
            if massless:
                mn -= back  # the cable transmits it
            else:
                Tw -= back
        if a_s < ankle.low or a_s > ankle.high:
            Ts += ankle.stop_torque(a_s, uF - us)
        if a_w < ankle.low or a_w > ankle.high:
            stop = ankle.stop_torque(a_w, uG - uw)
            if massless:
                mn += stop  # the cable transmits it
            else:
                Tw += stop
        # EQUATIONS 2.6: rolling; TF and TG act on the feet, -Ts and -Tw on the legs
        TF = Ts - s.C * uF
        TG = Tw
        if with_terms:
            # EQUATIONS 12
            Th += hip_sign * terms.torque_on_hip(hip_sign * hip, hip_sign * hd)
            terms.act_on_ankle(s, a_s, uF - us, p, up)
            terms.act_on_ankle(w, a_w, uG - uw, n, un)
            mp += s.extra_motor
            mn += w.extra_motor
            Ts += s.extra_ankle
            TF += s.extra_ankle
            if massless:
                mn += w.extra_ankle
            else:
                Tw += w.extra_ankle
                TG += w.extra_ankle
        # EQUATIONS 5.3: generalised forces on foot s, leg s, leg w
        Q1 = TF - e * Px - f * Py
        Q2 = Th - Ts - Us * ax + Vs * ay + swing * uw2
        Q3 = Aw * ax - Bw * ay - swing * us2 - Th - Tw
        Rx = 0.0
        Ry = 0.0
        if brush and gap < 0.0:
            # EQUATIONS 9: the swing foot brushes the floor with its sole, normal force and sliding friction
            Ry = -body.sole.k * gap - body.sole.c * (f * uF - ls * us - fw * uG + lsw * uw)
            if Ry > 0.0:
                Rx = -body.sole.mu * Ry * smoothed_sign((e * uF + lc * us - ew * uG - lcw * uw) * body.sole.per_m_s)
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
        # EQUATIONS 5.3: accelerations of F_s, th_s, th_w, and of the motors
        b1 = Q1 - t13 * Q3
        b2 = Q2 - t23 * Q3
        aF = n22 * b1 - n12 * b2
        as_ = n11 * b2 - n12 * b1
        aw = i33 * Q3 - t13 * aF - t23 * as_
        ap = mp * iJA
        an = mn * iJA
        if double_stance:
            # EQUATIONS 6: the other foot closes the linkage by its force (Rx, Ry)
            uG2 = uG * uG
            om = body.closing_rate
            vx_ = e * uF + lc * us - ew * uG - lcw * uw
            vy_ = f * uF - ls * us - fw * uG + lsw * uw
            bx = fw * uG2 - lsw * uw2 - f * uF2 + ls * us2 - om * (2.0 * vx_ + om * gap_x)
            by = dfw * uG2 - lcw * uw2 - df * uF2 + lc * us2 - om * (2.0 * vy_ + om * gap)
            TG -= w.C * uG
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
            aG = aw + an  # EQUATIONS 5.4
        else:
            aG = TG * w.inverse_Jf
        if stage == 0:
            # EQUATIONS 5.3: force on the stance foot, rate of the whole momentum less gravity and the other foot
            s.Fx = Px + (M * e * aF + Us * as_ - Aw * aw - Rx)
            s.Fy = Py + (M * f * aF - Vs * as_ + Bw * aw - Ry)
            w.Fx = Rx
            w.Fy = Ry
            s.foot_acc = aF
            s.acc = as_
            w.acc = aw
            w.foot_acc = aG
            s.motor_acc = ap
            w.motor_acc = an
            if stages == 1:
                return
            # EQUATIONS 15: the next stage; k: first accelerations, q: sums k1 + k2 + k3
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
    # the step's end: sines of the last stage, angles, and rates by k1 + 2 k2 + 2 k3 + k4
    s.known_foot, s.known_angle, w.known_angle, w.known_foot = F, th, tw, G
    s.sin_foot, s.cos_foot, s.sin_leg, s.cos_leg = sF, cF, st, ct
    w.sin_leg, w.cos_leg, w.sin_foot, w.cos_foot = sw, cw, sG, cG
    if double_stance:
        F = F0 + h * (uF0 + sixth * qF)
        th = th0 + h * (us0 + sixth * qs)
        tw = tw0 + h * (uw0 + sixth * qw)
        G = G0 + h * (uG0 + sixth * qG)
    s.foot_angle = F
    s.angle = th
    w.angle = tw
    w.foot_angle = G
    s.motor_angle = p0 + h * (up0 + sixth * qp)
    w.motor_angle = n0 + h * (un0 + sixth * qn)
    s.foot_rate = uF0 + sixth * (2.0 * qF - kF + aF)
    s.rate = us0 + sixth * (2.0 * qs - ks_ + as_)
    w.rate = uw0 + sixth * (2.0 * qw - kw + aw)
    w.foot_rate = uG0 + sixth * (2.0 * qG - kG + aG)
    s.motor_rate = up0 + sixth * (2.0 * qp - kp + ap)
    w.motor_rate = un0 + sixth * (2.0 * qn - kn + an)
    if double_stance:
        body.update_pose()
        return
    # EQUATIONS 4: the geometry of stage 3 is that of the end, so this is `update_pose` with the numbers at hand
    body.hip_x = s.anchor + r * (F - sg) - f + ls
    body.hip_y = s.height + e + lc
    s.gap = 0.0
    w.gap = gap
