"""A foot meets the floor (EQUATIONS 8)."""

import cython

from ranger_sim.plant.mechanics.body import DOUBLE, FLIGHT, SINGLE, Body
from ranger_sim.plant.mechanics.contact_equations import (
    APART,
    COLUMN_FOOT,
    COLUMN_IMPULSE,
    COLUMN_LEG,
    COLUMN_VX,
    COLUMN_VY,
    SLIDES_BACK,
    SLIDES_ON,
    STICKS,
    ContactEquations,
)
from ranger_sim.plant.mechanics.leg import Leg


@cython.cfunc
def touch(body: "Body", leg: "Leg") -> None:
    """The leg's foot meets the floor: anchor it, take the impact, count a step when it strikes ahead."""
    before: Leg = body.stance  # the stance leg, or the last one
    after: Leg = body.swing
    other: Leg = body.other(leg)
    energy: cython.double = body.energy_J()
    ahead: cython.double
    strike: cython.bint
    set_down(body, leg)
    ahead = body.contact_x(leg) - body.contact_x(other)
    strike = leg is not body.last_strike and ahead > body.strike_ahead
    if body.coulomb:
        collide(body, leg, body.mode != FLIGHT)
        take_states(body, leg)
    elif body.mode == FLIGHT:
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
    if body.mode == SINGLE and body.swing.Jf == 0.0:
        body.swing.limp()


@cython.cfunc
def set_down(body: "Body", leg: "Leg") -> cython.void:
    """Anchor the foot at its place, and at its depth if it strikes with its sole already pressed."""
    body.anchor_foot(leg)
    leg.armed = False
    leg.height += leg.gap


@cython.cfunc
def land(body: "Body", leg: "Leg") -> None:
    """From flight to single stance on this leg."""
    impact(body, leg is body.outer, leg is body.inner)
    body.mode = SINGLE
    body.stand_on(leg)


@cython.cfunc
def close_linkage(body: "Body", leg: "Leg") -> None:
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


@cython.ccall
def impact(body: "Body", outer: cython.bint, inner: cython.bint) -> None:
    """Rates just after the feet named here are at rest on the floor, by a pull if need be (EQUATIONS 8).

    The motors, behind their cables, keep their rates. Each leg keeps the impulse that its foot took, 0 without one.
    """
    equations: ContactEquations = body.equations
    write_momentum(body)
    equations.solve(STICKS if outer else APART, STICKS if inner else APART)
    take_rates(body)


@cython.ccall
def collide(body: "Body", leg: "Leg", other_stands: cython.bint) -> None:
    """Rates just after this leg's foot has met the floor, which neither pulls nor holds beyond friction (EQUATIONS 8).

    `other_stands`: the other foot is on the floor too. The resulting states of the feet are left in the equations'
    `state`.
    """
    equations: ContactEquations = body.equations
    write_momentum(body)
    if not other_stands:
        equations.leave_out(body.other(leg).side)
    equations.settle(leg.side)
    take_rates(body)


@cython.cfunc
def take_states(body: "Body", leg: "Leg") -> None:
    """The body's mode after `collide`, and which feet slide. `leg` touched: it leads when both stand."""
    equations: ContactEquations = body.equations
    other: Leg = body.other(leg)
    stands: cython.bint = equations.state[leg.side] != APART
    other_stands: cython.bint = equations.state[other.side] != APART
    foot: Leg
    for foot in (leg, other):
        if equations.state[foot.side] == APART:
            foot.armed = False
    take_slides(body)
    if stands and other_stands:
        body.mode = DOUBLE
    elif stands or other_stands:
        body.mode = SINGLE
    else:
        body.mode = FLIGHT
    body.stand_on(leg if stands else other)


@cython.cfunc
def take_slides(body: "Body") -> cython.void:
    """Read from the equations' `state` which feet slide, and in which direction."""
    equations: ContactEquations = body.equations
    leg: Leg
    for leg in (body.outer, body.inner):
        leg.slide = 0
        if equations.state[leg.side] == SLIDES_ON:
            leg.slide = 1
        elif equations.state[leg.side] == SLIDES_BACK:
            leg.slide = -1
    body.sliding = body.outer.slide != 0 or body.inner.slide != 0


@cython.cfunc
def write_momentum(body: "Body") -> None:
    """Write into the equations: earlier momenta of hip, legs and feet, and the motion of a massless foot."""
    row: cython.longlong
    column: cython.longlong
    total: cython.double
    leg: Leg
    o: Leg = body.outer
    i: Leg = body.inner
    equations: ContactEquations = body.equations
    before = (body.hip_vx, body.hip_vy, o.rate, i.rate, o.foot_rate, i.foot_rate)
    equations.begin(o, i, body.M, body.hip.J, body.sole.mu)
    for row in range(COLUMN_IMPULSE):
        total = 0.0
        for column in range(COLUMN_IMPULSE):
            total += equations.mass[6 * row + column] * before[column]
        equations.right[row] = total
    for leg in (o, i):
        if leg.Jf == 0.0:
            equations.follow[leg.side] = leg.motor_rate


@cython.cfunc
def take_rates(body: "Body") -> None:
    """Read from the equations: rates of hip, legs and feet, and the impulses on the feet."""
    leg: Leg
    x: cython.p_double = body.equations.solution
    body.hip_vx = x[COLUMN_VX]
    body.hip_vy = x[COLUMN_VY]
    for leg in (body.outer, body.inner):
        leg.rate = x[COLUMN_LEG + leg.side]
        leg.foot_rate = x[COLUMN_FOOT + leg.side]
        leg.impulse_x = x[COLUMN_IMPULSE + 2 * leg.side]
        leg.impulse_y = x[COLUMN_IMPULSE + 2 * leg.side + 1]
