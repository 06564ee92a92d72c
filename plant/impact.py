# cython: boundscheck=False, wraparound=False, cdivision=True
# (indices are those of `matrix` and `solution`, all written out; no integer is divided)
"""A foot meets the floor (EQUATIONS 8)."""

import cython

if not cython.compiled:
    from math import cos, fabs, sin


def touch(body, foot: cython.longlong) -> None:
    """The foot meets the floor: anchor it, take the impact, count a step when it strikes ahead."""
    other: cython.longlong = 1 - foot
    angle: cython.double = body.foot_outer if foot == 0 else body.foot_inner
    energy: cython.double = body.energy_J()
    ahead: cython.double
    strike: cython.bint
    set_down(body, foot)
    ahead = body.contact_x(foot) - body.contact_x(other)
    strike = foot != body.last_strike_leg and ahead > body.strike_ahead
    if body.mode == 3:
        land(body, foot)
    else:
        close_linkage(body, foot)
    body.record.touch(
        body.event_time_ns(),
        foot,
        strike,
        ahead,
        body.contact_x(foot),
        angle,
        (body.P_stance_x, body.P_stance_y, body.P_swing_x, body.P_swing_y),
        energy - body.energy_J(),
        body.mode == 2,
        body.passing_gap,
        body.height_outer if foot == 0 else body.height_inner,
    )
    body.changes += 1
    if strike:
        body.passing_gap = 1.0
        body.last_strike_leg = foot
        body.foothold_due = True
        body.released_s = body.time_s
    body.brush = False
    if body.mode == 1 and body.Jf == 0.0:
        body.limp_foot(other)


def set_down(body, foot: cython.longlong) -> cython.void:
    """The foot stands where it is, and as deep as it is when it strikes with its sole already pressed."""
    body.anchor(foot)
    if foot == 0:
        body.outer_armed = False
        body.height_outer += body.gap_outer
    else:
        body.inner_armed = False
        body.height_inner += body.gap_inner


def land(body, foot: cython.longlong) -> None:
    """From flight to single stance on this foot."""
    impact(body, foot == 0, foot == 1)
    if foot != body.stance:
        body.P_stance_x = 0.0
        body.P_stance_y = 0.0
    body.mode = 1
    body.stance = foot


def close_linkage(body, foot: cython.longlong) -> None:
    """From single to double stance with this foot, or on to it alone.

    The rule of the appendix keeps the trailing foot on the floor, by a pull if need be (EQUATIONS 8).
    """
    body.save()
    impact(body, True, True)
    if body.P_stance_y < 0.0 and body.unilateral:
        body.restore()
        impact(body, foot == 0, foot == 1)
        body.mode = 1
        if foot == 1:
            body.outer_armed = False
        else:
            body.inner_armed = False
    else:
        body.mode = 2
    body.stance = foot


def impact(body, outer: cython.bint, inner: cython.bint) -> None:
    """Rates just after the feet named here are at rest on the floor (EQUATIONS 8).

    The motors, behind their cables, keep their rates. Impulses are left in P_stance_* and P_swing_*, where
    the stance foot is the one of `body.stance` before the impact.
    """
    row: cython.longlong = 6
    foot: cython.longlong
    x: cython.p_double = body.solution
    write_momentum(body)
    for foot in range(2):
        if outer if foot == 0 else inner:
            write_foot_at_rest(body, foot, row)
            row += 2
        elif body.Jf == 0.0:
            write_foot_with_motor(body, foot)
    eliminate(body, row)
    body.hip_vx = x[0]
    body.hip_vy = x[1]
    body.leg_outer_rate = x[2]
    body.leg_inner_rate = x[3]
    body.foot_outer_rate = x[4]
    body.foot_inner_rate = x[5]
    body.P_stance_x = 0.0
    body.P_stance_y = 0.0
    body.P_swing_x = 0.0
    body.P_swing_y = 0.0
    row = 6
    for foot in range(2):
        if outer if foot == 0 else inner:
            if foot == body.stance:
                body.P_stance_x = x[row]
                body.P_stance_y = x[row + 1]
            else:
                body.P_swing_x = x[row]
                body.P_swing_y = x[row + 1]
            row += 2


def write_momentum(body) -> None:
    """Rows 0 ... 5 of `matrix`: what the momentum of hip, legs and feet is, and was before.

    A row has 11 numbers: unknowns vx, vy, leg outer, leg inner, foot outer, foot inner, up to four impulses; last the
    right-hand side.
    """
    row: cython.longlong
    column: cython.longlong
    total: cython.double
    Ao: cython.double = body.mc_outer * cos(body.leg_outer) + body.mw_outer * sin(body.leg_outer)
    Bo: cython.double = body.mc_outer * sin(body.leg_outer) - body.mw_outer * cos(body.leg_outer)
    Ai: cython.double = body.mc_inner * cos(body.leg_inner) + body.mw_inner * sin(body.leg_inner)
    Bi: cython.double = body.mc_inner * sin(body.leg_inner) - body.mw_inner * cos(body.leg_inner)
    before = (
        body.hip_vx,
        body.hip_vy,
        body.leg_outer_rate,
        body.leg_inner_rate,
        body.foot_outer_rate,
        body.foot_inner_rate,
    )
    a: cython.p_double = body.matrix
    for row in range(110):
        a[row] = 0.0
    a[0] = body.M
    a[2] = -Ao
    a[3] = -Ai
    a[11 + 1] = body.M
    a[11 + 2] = Bo
    a[11 + 3] = Bi
    a[22] = -Ao
    a[22 + 1] = Bo
    a[22 + 2] = body.J_outer + body.JH
    a[22 + 3] = -body.JH
    a[33] = -Ai
    a[33 + 1] = Bi
    a[33 + 2] = -body.JH
    a[33 + 3] = body.J_inner + body.JH
    a[44 + 4] = body.Jf
    a[55 + 5] = body.Jf
    for row in range(6):
        total = 0.0
        for column in range(6):
            total += a[11 * row + column] * before[column]
        a[11 * row + 10] = total


def write_foot_at_rest(body, foot: cython.longlong, row: cython.longlong) -> cython.void:
    """Rows `row` and the next: this foot does not move along the floor and upwards, which takes two impulses."""
    column: cython.longlong
    angle: cython.double = body.foot_outer if foot == 0 else body.foot_inner
    lean: cython.double = body.leg_outer if foot == 0 else body.leg_inner
    excess: cython.double = body.excess(angle)
    a: cython.p_double = body.matrix
    a[11 * row] = 1.0
    a[11 * row + 2 + foot] = -body.el * cos(lean)
    a[11 * row + 4 + foot] = -(body.r * cos(excess) - body.d * cos(angle))
    a[11 * (row + 1) + 1] = 1.0
    a[11 * (row + 1) + 2 + foot] = body.el * sin(lean)
    a[11 * (row + 1) + 4 + foot] = -(body.d * sin(angle) - body.r * sin(excess))
    for column in range(6):
        a[11 * column + row] = -a[11 * row + column]
        a[11 * column + row + 1] = -a[11 * (row + 1) + column]


def write_foot_with_motor(body, foot: cython.longlong) -> cython.void:
    """A massless foot in the air has no momentum of its own: it follows its motor."""
    a: cython.p_double = body.matrix
    a[11 * (4 + foot) + 4 + foot] = 1.0
    a[11 * (4 + foot) + 2 + foot] = -1.0
    a[11 * (4 + foot) + 10] = body.motor_outer_rate if foot == 0 else body.motor_inner_rate


def eliminate(body, n: cython.longlong) -> cython.void:
    """Solve the first n equations of `matrix` (rows of 11, right-hand side last) by Gauss with pivots."""
    i: cython.longlong
    j: cython.longlong
    k: cython.longlong
    best: cython.longlong
    factor: cython.double
    held: cython.double
    a: cython.p_double = body.matrix
    x: cython.p_double = body.solution
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
