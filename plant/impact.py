# cython: boundscheck=False, wraparound=False, cdivision=True
# (indices are those of `matrix` and `solution`, all written out; no integer is divided)
"""A foot meets the floor (EQUATIONS 8)."""

import cython

# C constants when compiled: the same numbers stand in the .pxd, and a test holds them together.
if not cython.compiled:
    from math import cos, fabs, sin

    from ranger_sim.plant.body import DOUBLE, FLIGHT, SINGLE
    from ranger_sim.plant.leg import Leg

    # Columns of `Body.matrix`, and rows of `Body.solution`: what is unknown, and last the right-hand side.
    COLUMN_VX = 0  # of the hip
    COLUMN_VY = 1
    COLUMN_LEG = 2  # rate of the outer, and next of the inner leg
    COLUMN_FOOT = 4  # rate of the outer, and next of the inner foot
    COLUMN_IMPULSE = 6  # x and y of the first foot at rest, and of the second
    COLUMN_RIGHT = 10
    COLUMNS = 11


def touch(body, leg) -> None:
    """The leg's foot meets the floor: anchor it, take the impact, count a step when it strikes ahead."""
    before: Leg = body.stance  # the leg that stood, or stood last
    after: Leg = body.swing
    other: Leg = body.other(leg)
    energy: cython.double = body.energy_J()
    ahead: cython.double
    strike: cython.bint
    set_down(body, leg)
    ahead = body.contact_x(leg) - body.contact_x(other)
    strike = leg is not body.last_strike and ahead > body.strike_ahead
    if body.mode == FLIGHT:
        land(body, leg)
    else:
        close_linkage(body, leg)
    body.record.touch(
        body.event_time_ns(),
        leg.side,
        strike,
        ahead,
        body.contact_x(leg),
        leg.foot_angle,
        (before.impulse_x, before.impulse_y, after.impulse_x, after.impulse_y),
        energy - body.energy_J(),
        body.mode == DOUBLE,
        body.seen.passing_gap,
        leg.height,
    )
    body.changes += 1
    if strike:
        body.seen.passing_gap = 1.0
        body.last_strike = leg
        body.seen.foothold_due = True
        body.seen.released_s = body.time_s
    body.brush = False
    if body.mode == SINGLE and other.Jf == 0.0:
        other.limp()


def set_down(body, leg) -> cython.void:
    """The foot stands where it is, and as deep as it is when it strikes with its sole already pressed."""
    body.anchor_foot(leg)
    leg.armed = False
    leg.height += leg.gap


def land(body, leg) -> None:
    """From flight to single stance on this leg."""
    impact(body, leg is body.outer, leg is body.inner)
    body.mode = SINGLE
    body.stand_on(leg)


def close_linkage(body, leg) -> None:
    """From single to double stance with this leg, or on to it alone.

    The rule of the appendix keeps the trailing foot on the floor, by a pull if need be (EQUATIONS 8).
    """
    trailing: Leg = body.other(leg)
    body.save()
    impact(body, True, True)
    if body.stance.impulse_y < 0.0 and body.unilateral:
        body.restore()
        impact(body, leg is body.outer, leg is body.inner)
        body.mode = SINGLE
        trailing.armed = False
    else:
        body.mode = DOUBLE
    body.stand_on(leg)


def impact(body, outer: cython.bint, inner: cython.bint) -> None:
    """Rates just after the feet named here are at rest on the floor (EQUATIONS 8).

    The motors, behind their cables, keep their rates. Each leg keeps the impulse that its foot took, 0 without one.
    """
    row: cython.longlong = COLUMN_IMPULSE
    leg: Leg
    x: cython.p_double = body.solution
    write_momentum(body)
    for leg in (body.outer, body.inner):
        if outer if leg is body.outer else inner:
            write_foot_at_rest(body, leg, row)
            row += 2
        elif leg.Jf == 0.0:
            write_foot_with_motor(body, leg)
    eliminate(body, row)
    body.hip_vx = x[COLUMN_VX]
    body.hip_vy = x[COLUMN_VY]
    row = COLUMN_IMPULSE
    for leg in (body.outer, body.inner):
        leg.rate = x[COLUMN_LEG + leg.side]
        leg.foot_rate = x[COLUMN_FOOT + leg.side]
        leg.impulse_x = 0.0
        leg.impulse_y = 0.0
        if outer if leg is body.outer else inner:
            leg.impulse_x = x[row]
            leg.impulse_y = x[row + 1]
            row += 2


def write_momentum(body) -> None:
    """Rows 0 ... 5 of `matrix`: what the momentum of hip, legs and feet is, and was before.

    Rows are in the order of the columns: along x, along y, of each leg about the hip, of each foot about its ankle.
    """
    row: cython.longlong
    column: cython.longlong
    on: cython.longlong
    total: cython.double
    A: cython.double
    B: cython.double
    leg: Leg
    o: Leg = body.outer
    i: Leg = body.inner
    before = (body.hip_vx, body.hip_vy, o.rate, i.rate, o.foot_rate, i.foot_rate)
    JH: cython.double = body.hip.J
    a: cython.p_double = body.matrix
    for row in range(110):
        a[row] = 0.0
    a[COLUMN_VX] = body.M
    a[COLUMNS + COLUMN_VY] = body.M
    for leg in (o, i):
        A = leg.mc * cos(leg.angle) + leg.mw * sin(leg.angle)
        B = leg.mc * sin(leg.angle) - leg.mw * cos(leg.angle)
        on = COLUMN_LEG + leg.side
        a[on] = -A
        a[COLUMNS + on] = B
        a[COLUMNS * on + COLUMN_VX] = -A
        a[COLUMNS * on + COLUMN_VY] = B
        a[COLUMNS * on + COLUMN_LEG] = -JH
        a[COLUMNS * on + COLUMN_LEG + 1] = -JH
        a[COLUMNS * on + on] = leg.J + JH
        on = COLUMN_FOOT + leg.side
        a[COLUMNS * on + on] = leg.Jf
    for row in range(COLUMN_IMPULSE):
        total = 0.0
        for column in range(COLUMN_IMPULSE):
            total += a[COLUMNS * row + column] * before[column]
        a[COLUMNS * row + COLUMN_RIGHT] = total


def write_foot_at_rest(body, leg, row: cython.longlong) -> cython.void:
    """Rows `row` and the next: this foot does not move along the floor and upwards, which takes two impulses."""
    column: cython.longlong
    angle: cython.double = leg.foot_angle
    excess: cython.double = leg.excess(angle)
    a: cython.p_double = body.matrix
    a[COLUMNS * row + COLUMN_VX] = 1.0
    a[COLUMNS * row + COLUMN_LEG + leg.side] = -leg.el * cos(leg.angle)
    a[COLUMNS * row + COLUMN_FOOT + leg.side] = -(leg.r * cos(excess) - leg.d * cos(angle))
    a[COLUMNS * (row + 1) + COLUMN_VY] = 1.0
    a[COLUMNS * (row + 1) + COLUMN_LEG + leg.side] = leg.el * sin(leg.angle)
    a[COLUMNS * (row + 1) + COLUMN_FOOT + leg.side] = -(leg.d * sin(angle) - leg.r * sin(excess))
    for column in range(COLUMN_IMPULSE):
        a[COLUMNS * column + row] = -a[COLUMNS * row + column]
        a[COLUMNS * column + row + 1] = -a[COLUMNS * (row + 1) + column]


def write_foot_with_motor(body, leg) -> cython.void:
    """A massless foot in the air has no momentum of its own: it follows its motor."""
    row: cython.longlong = COLUMN_FOOT + leg.side
    a: cython.p_double = body.matrix
    a[COLUMNS * row + row] = 1.0
    a[COLUMNS * row + COLUMN_LEG + leg.side] = -1.0
    a[COLUMNS * row + COLUMN_RIGHT] = leg.motor_rate


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
            if fabs(a[COLUMNS * i + k]) > fabs(a[COLUMNS * best + k]):
                best = i
        if best != k:
            for j in range(COLUMNS):
                held = a[COLUMNS * k + j]
                a[COLUMNS * k + j] = a[COLUMNS * best + j]
                a[COLUMNS * best + j] = held
        for i in range(k + 1, n):
            factor = a[COLUMNS * i + k] / a[COLUMNS * k + k]
            if factor != 0.0:
                for j in range(k, n):
                    a[COLUMNS * i + j] -= factor * a[COLUMNS * k + j]
                a[COLUMNS * i + COLUMN_RIGHT] -= factor * a[COLUMNS * k + COLUMN_RIGHT]
    for k in range(n - 1, -1, -1):
        factor = a[COLUMNS * k + COLUMN_RIGHT]
        for j in range(k + 1, n):
            factor -= a[COLUMNS * k + j] * x[j]
        x[k] = factor / a[COLUMNS * k + k]
