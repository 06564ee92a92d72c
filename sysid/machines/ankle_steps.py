# cython: cdivision=True
# (what is divided by: inertias and steps above zero, and 1 plus a share of the friction below 1)
"""An ankle's motion step by step, with the friction of its motor: the loops of `ankle_motion.py` over time.

Each step is linear but for the friction y on the motor: x_1 = K x_0 + f - b y, six states p, u, a, w, r, I. Friction
is implicit. With a width c of its sign y = (C_0 + m |I_1|) tanh(u_1 / c). Without one it is dry: the motor stands,
u_1 = 0, while the y that this takes is within C_0 + m |I_1|, and slips with y at that limit otherwise.
"""

import cython
from cython.cimports.libc.math import fabs, tanh

CLEAR: cython.double = 19.0  # widths from which on tanh is 1
FASTEST_rad_s: cython.double = 1e3  # beyond it no geared machine moves
MOST_TRIES: cython.int = 60  # of one step's friction
NEAR_Nm: cython.double = 1e-12


@cython.ccall
@cython.exceptval(-1)
@cython.boundscheck(False)
@cython.wraparound(False)
def walk(
    keeps: cython.double[::1],
    forced: cython.double[::1],
    by: cython.double[::1],
    friction: cython.double[::1],
    states: cython.double[::1],
    braking: cython.double[::1],
) -> cython.int:
    """Fill states (6 m,) from its first six, and braking (m,) with each step's friction in N m; return the steps taken.

    keeps: (36,) K row by row; forced: (6 (m - 1),) f of each step; by: (6,) b; friction: C_0, m, c.
    """
    C_0: cython.double = friction[0]
    m: cython.double = friction[1]
    width: cython.double = friction[2]
    by_u: cython.double = by[1]
    by_I: cython.double = by[5]
    at: cython.int
    row: cython.int
    count: cython.int = braking.shape[0]
    new: cython.int
    free: cython.double
    current: cython.double
    y: cython.double
    way: cython.double
    loads: cython.double
    stands: cython.bint
    for at in range(1, count):
        new = 6 * at
        for row in range(6):
            states[new + row] = (
                keeps[6 * row] * states[new - 6]
                + keeps[6 * row + 1] * states[new - 5]
                + keeps[6 * row + 2] * states[new - 4]
                + keeps[6 * row + 3] * states[new - 3]
                + keeps[6 * row + 4] * states[new - 2]
                + keeps[6 * row + 5] * states[new - 1]
                + forced[new - 6 + row]
            )
        free = states[new + 1]
        current = states[new + 5]
        way = 1.0 if free > 0.0 else -1.0
        loads = m if current > by_I * way * C_0 else -m  # by the sign of the current with that friction
        y = way * (C_0 + loads * current) / (1.0 + loads * by_I * way)
        stands = width <= 0.0 and way * (free - by_u * y) <= 0.0
        if stands:
            y = free / by_u
        elif way * (free - by_u * y) < CLEAR * width:
            y = smoothed(free, by_u, current, -by_I, C_0, m, width)
        for row in range(6):
            states[new + row] -= by[row] * y
        if stands:  # to the last digit
            states[new + 1] = 0.0
        braking[at] = y
        if not -FASTEST_rad_s < states[new + 1] < FASTEST_rad_s:
            return at
    return count


@cython.ccall
@cython.exceptval(-1)
@cython.boundscheck(False)
@cython.wraparound(False)
def respond(
    keeps: cython.double[::1],
    by: cython.double[::1],
    bends: cython.double[::1],
    columns: cython.int,
    changes: cython.double[::1],
) -> cython.int:
    """Small changes (m, 6, columns) of the states, in place of those that each step adds: (6 m columns,), row by row.

    keeps: (36,) K of `walk`; by: (6,) b; bends: (2 m,) derivatives of each step's friction by u and I, the first of
    them below 0 where the motor stands. The first step stays as it is.
    """
    by_u: cython.double = by[1]
    by_I: cython.double = by[5]
    at: cython.int
    row: cython.int
    column: cython.int
    new: cython.int
    old: cython.int
    count: cython.int = bends.shape[0] // 2
    y: cython.double
    for at in range(1, count):
        for column in range(columns):
            new = 6 * columns * at + column
            old = new - 6 * columns
            for row in range(6):
                changes[new + row * columns] += (
                    keeps[6 * row] * changes[old]
                    + keeps[6 * row + 1] * changes[old + columns]
                    + keeps[6 * row + 2] * changes[old + 2 * columns]
                    + keeps[6 * row + 3] * changes[old + 3 * columns]
                    + keeps[6 * row + 4] * changes[old + 4 * columns]
                    + keeps[6 * row + 5] * changes[old + 5 * columns]
                )
            if bends[2 * at] < 0.0:
                y = changes[new + columns] / by_u
            else:
                y = bends[2 * at] * changes[new + columns] + bends[2 * at + 1] * changes[new + 5 * columns]
                y /= 1.0 + bends[2 * at] * by_u + bends[2 * at + 1] * by_I
            for row in range(6):
                changes[new + row * columns] -= by[row] * y
            if bends[2 * at] < 0.0:
                changes[new + columns] = 0.0
    return count


@cython.ccall
@cython.exceptval(check=False)
def smoothed(
    free: cython.double,
    v: cython.double,
    current: cython.double,
    by_r: cython.double,
    C_0: cython.double,
    m: cython.double,
    width: cython.double,
) -> cython.double:
    """r = (C_0 + m |current + by_r r|) tanh((free - v r) / width) by Newton's method, with bisection where that leaves
    the known bounds: the difference of both sides grows with r."""
    high: cython.double = (C_0 + m * fabs(current)) / (1.0 - fabs(m * by_r)) + NEAR_Nm
    low: cython.double = -high
    r: cython.double = min(max(free / v, low), high)
    slip: cython.double
    bound: cython.double
    missed: cython.double
    side: cython.double
    was: cython.double
    for _ in range(MOST_TRIES):
        slip = tanh((free - v * r) / width)
        bound = C_0 + m * fabs(current + by_r * r)
        missed = r - bound * slip
        if missed > 0.0:
            high = r
        else:
            low = r
        side = m * by_r if current + by_r * r > 0.0 else -m * by_r
        was = r
        r -= missed / (1.0 - side * slip + bound * (1.0 - slip * slip) * v / width)
        if not low <= r <= high:
            r = 0.5 * (low + high)
        if fabs(r - was) < NEAR_Nm:
            break
    return r
