"""Whether a standing foot sticks, slides or leaves, while no foot strikes (EQUATIONS 9)."""

from typing import Final

import cython
from cython.cimports.libc.math import fabs

from ranger_sim.plant.mechanics.body import DOUBLE, FLIGHT, SINGLE, Body
from ranger_sim.plant.mechanics.contact_equations import APART, SLIDES_BACK, SLIDES_ON, STICKS, ContactEquations
from ranger_sim.plant.mechanics.leg import Leg
from ranger_sim.plant.mechanics.sliding import slide, write_forces
from ranger_sim.plant.mechanics.stance import on_feet
from ranger_sim.plant.walking.impact import collide, take_states
from ranger_sim.plant.walking.lift_off import leave

# values of `Body.event`, about `Body.event_leg`
NO_EVENT: Final = 0
TOUCH: Final = 1
LIFT_OFF: Final = 2
SLIDE: Final = 3
STICK: Final = 4


@cython.cfunc
@cython.exceptval(check=False)
def asks_too_much(body: "Body") -> cython.bint:
    """Whether a foot, by the forces left in the legs, would have to be pulled or held beyond friction."""
    if body.mode == SINGLE:
        return margin(body, body.stance) < 0.0
    if body.mode != DOUBLE:
        return False
    return margin(body, body.outer) < 0.0 or margin(body, body.inner) < 0.0


@cython.cfunc
@cython.exceptval(check=False)
def margin(body: "Body", leg: "Leg") -> cython.double:
    """Remaining friction of a standing foot, N; of a sliding one, its remaining normal force."""
    if leg.slide != 0:
        return leg.Fy
    return body.sole.mu * leg.Fy - fabs(leg.Fx)


@cython.cfunc
@cython.exceptval(check=False)
def near_the_bounds(body: "Body") -> cython.bint:
    """Whether an event of the grip may happen within this step, by the forces at its start.

    Sliding feet, and two standing feet, are checked after every step. In single stance forces change by less than 2 N
    in a step of 250 us (17 Hz of cable and motor with 50 N), so 20 N ahead of the bound is early enough; chosen by us.
    Events missed because a torque jumps are handled at the start of the next step.
    """
    if body.mode == SINGLE and not body.sliding:
        return margin(body, body.stance) < 20.0
    return body.mode == SINGLE or body.mode == DOUBLE


@cython.cfunc
def grip_witness(body: "Body", value: cython.double) -> cython.double:
    """The witness of the next event of the grip: `value` of another event, or less, and then `event` names it.

    SLIDE: a foot's friction is used up (N). LIFT_OFF: the normal force of a sliding foot (N). STICK: the speed of a
    sliding foot (m/s), and 1e-9 m/s beyond zero, so that a slide does not end where it begins.
    """
    leg: Leg
    rest: cython.double
    if body.mode != SINGLE and body.mode != DOUBLE:
        return value
    if body.sliding:
        slide(body, 0.0, 1)
    else:
        on_feet(body, 0.0, 1)
    for leg in (body.outer, body.inner):
        if body.mode == SINGLE and leg is not body.stance:
            continue
        rest = margin(body, leg)
        if rest < value:
            value = rest
            body.event = LIFT_OFF if leg.slide != 0 else SLIDE
            body.event_leg = leg
        if leg.slide != 0:
            rest = leg.slide * body.slip_m_per_s(leg) + 1e-9
            if rest < value:
                value = rest
                body.event = STICK
                body.event_leg = leg
    return value


@cython.ccall
def regrip(body: "Body") -> cython.bint:
    """Find the states of the standing feet from here on, by trying (EQUATIONS 9); True when one changes.

    `event` of `event_leg` happens now: SLIDE and STICK exclude the foot's former state.
    """
    leg: Leg
    side: cython.longlong
    broken: cython.double
    x: ContactEquations = body.equations
    body.update_pose()
    body.update_hip_rates()
    for leg in (body.outer, body.inner):
        if leg.slide != 0:
            body.anchor_foot(leg)  # here it would stick
    write_forces(body)
    for leg in (body.outer, body.inner):
        if body.mode == DOUBLE or leg is body.stance:
            allow(body, leg)
    broken = x.settle(body.stance.side)
    if broken < -1e-6 and body.event == SLIDE:  # m/s^2: more than rounding
        # it cannot slide on (Painleve): at rest it may do anything, and something always fits
        side = body.event_leg.side
        x.allow_all(side)
        x.moving[side] = False
        broken = x.settle(body.stance.side)
    if broken < -1e-6:
        return jam(body)
    return take_grip(body)


@cython.cfunc
def allow(body: "Body", leg: "Leg") -> cython.void:
    """Set the possible states of this standing foot: a sliding one continues or leaves, any other may take any
    state."""
    x: ContactEquations = body.equations
    way: cython.longlong = leg.slide
    side: cython.longlong = leg.side
    if leg is body.event_leg and body.event == STICK:
        return
    if leg is body.event_leg and body.event == SLIDE:
        way = -1 if leg.Fx > 0.0 else 1  # against the friction that it has used up
    if way != 0:
        x.allow_only(side, SLIDES_ON if way > 0 else SLIDES_BACK)
        x.allowed[4 * side + APART] = True
        x.moving[side] = True


@cython.cfunc
def jam(body: "Body") -> cython.bint:
    """Apply impulses when no state of the feet fits: forces cannot keep them out of the floor (Painleve's paradox).

    True when those impulses have changed the feet's states.
    """
    outer: cython.longlong = body.outer.slide
    inner: cython.longlong = body.inner.slide
    mode: cython.longlong = body.mode
    collide(body, body.stance, mode == DOUBLE)
    take_states(body, body.stance)
    body.record.jams += 1
    body.changes += 1
    return body.mode != mode or body.outer.slide != outer or body.inner.slide != inner


@cython.cfunc
def take_grip(body: "Body") -> cython.bint:
    """Set the feet to the states found by the equations in `state`; True when one changes."""
    leg: Leg
    way: cython.longlong
    x: ContactEquations = body.equations
    outer: cython.longlong = x.state[0]
    inner: cython.longlong = x.state[1]
    state: cython.longlong
    new: cython.bint = False
    for leg in (body.outer, body.inner):
        state = inner if leg is body.inner else outer
        if body.mode == FLIGHT or (body.mode == SINGLE and leg is not body.stance):
            continue
        if state == APART:
            leave(body, leg)
            new = True
            continue
        way = 0
        if state != STICKS:
            way = 1 if state == SLIDES_ON else -1
        if way != leg.slide:
            new = True
            if leg.slide == 0:
                body.record.slides += 1
            leg.slide = way
    body.sliding = (body.mode == DOUBLE and body.swing.slide != 0) or (
        (body.mode == DOUBLE or body.mode == SINGLE) and body.stance.slide != 0
    )
    return new
