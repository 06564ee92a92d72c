# cython: cdivision=True
# (only by a difference of witnesses of opposite sign)
"""A step of the body with the events inside it, located and handled at their times (EQUATIONS 9, 15).

Events are of a leg: its foot touches the floor, lifts off, begins to slide, or sticks again. Each has a witness, a
number that is above zero before and falls through zero as it happens: the clearance of a foot in the air (m), the
normal force on a standing one (N), its remaining friction (N), its speed (m/s).
"""

from typing import Final

import cython

from ranger_sim.plant.mechanics.air import in_air
from ranger_sim.plant.mechanics.body import DOUBLE, FALLEN, HELD, SINGLE, Body
from ranger_sim.plant.mechanics.leg import Leg
from ranger_sim.plant.mechanics.sliding import slide
from ranger_sim.plant.mechanics.stance import on_feet
from ranger_sim.plant.walking.compliant import press
from ranger_sim.plant.walking.grip import (
    LIFT_OFF,
    NO_EVENT,
    SLIDE,
    STICK,
    TOUCH,
    asks_too_much,
    grip_witness,
    near_the_bounds,
    regrip,
)
from ranger_sim.plant.walking.impact import touch
from ranger_sim.plant.walking.lift_off import leave, lets_go, may_leave, sole_ready
from ranger_sim.plant.walking.watch import watch

MOST_EVENTS: Final = 20  # in one step; later ones are left for the next step
MOST_TRIES: Final = 60  # to locate an event; a bisection needs 22


@cython.ccall
def advance(body: "Body", h: cython.double) -> None:
    """Move on by `h` seconds under constant laws of the motors' torques, events located inside (EQUATIONS 15)."""
    remaining: cython.double = h
    used: cython.double
    again: cython.bint
    pieces: cython.longlong = 0
    body.elapsed = 0.0
    if body.floating and body.mode != FALLEN:
        press(body, h)
        remaining = 0.0
    while remaining > 0.0 and body.mode != FALLEN:
        pieces += 1
        if body.mode != HELD:  # no event in the operator's hands requires a step to be repeated
            body.save()
        move(body, remaining)
        if body.coulomb:
            again = asks_too_much(body) and pieces < MOST_EVENTS and change_grip(body, remaining)
            body.watched = near_the_bounds(body)
        else:
            again = body.outer.Fy < 0.0 or body.inner.Fy < 0.0
            again = again and pieces < MOST_EVENTS and let_pulled_foot_go(body, remaining)
        if again:
            continue  # a foot left the floor or lost its grip at the start of this piece: nothing has moved yet
        used = remaining
        if pieces < MOST_EVENTS and body.mode != HELD and witness(body) < 0.0:
            used = locate(body, remaining)
            body.elapsed += used
            act(body)
        else:
            body.elapsed += used
        remaining -= used
    if body.mode == FALLEN:
        body.elapsed = h
    body.time_s += h
    if body.mode != HELD and body.mode != FALLEN:
        watch(body, h)


@cython.cfunc
def move(body: "Body", h: cython.double) -> None:
    """One step of the equations of motion, in the body's present mode."""
    if body.sliding:
        slide(body, h, 4)
    elif body.mode == SINGLE or body.mode == DOUBLE:
        on_feet(body, h, 4)
    else:
        in_air(body, h, 4)
        body.update_pose()


@cython.cfunc
def change_grip(body: "Body", h: cython.double) -> cython.bint:
    """A foot would be pulled, or held beyond friction, at the start of this piece of `h` seconds: find its new state.

    True when it has a new one: then the body's state is that of the start.
    """
    body.restore()
    body.event = NO_EVENT
    if regrip(body):
        return True
    move(body, h)
    return False


@cython.cfunc
def let_pulled_foot_go(body: "Body", h: cython.double) -> cython.bint:
    """Let a foot go that the floor would have to pull at the start of this piece of `h` seconds.

    True when one was: then the state is that of the start. The foot that is pulled more is tried first.
    """
    first: Leg
    second: Leg
    if body.mode == SINGLE:
        if body.stance.Fy >= 0.0:
            return False
    elif body.mode != DOUBLE:
        return False
    body.restore()
    body.update_pose()
    first = body.outer if body.outer.Fy < body.inner.Fy else body.inner
    second = body.other(first)
    if first.Fy < 0.0 and free_to_leave(body, first):
        body.update_hip_rates()
        leave(body, first)
        return True
    if second.Fy < 0.0 and free_to_leave(body, second):
        body.update_hip_rates()
        leave(body, second)
        return True
    on_feet(body, h, 4)
    return False


@cython.cfunc
@cython.exceptval(check=False)
def clearance(leg: "Leg") -> cython.double:
    """The witness of a touch: the foot's gap, m. One that has just left the floor must first be clear of it."""
    return leg.gap + (0.0 if leg.armed else 2e-6)


@cython.cfunc
def free_to_leave(body: "Body", leg: "Leg") -> cython.bint:
    """Whether the normal force on this foot is the witness of its lift-off: it does not stay for another reason.

    A foot that is pulled and yet would not rise stays (EQUATIONS 9).
    """
    return may_leave(body, leg) and (leg.Fy >= 0.0 or sole_ready(body, leg) or lets_go(body, leg))


@cython.cfunc
def witness(body: "Body") -> cython.double:
    """The witness of the event that is next; below 0 when it lies behind. `event` and `event_leg` name it."""
    value: cython.double = 1.0  # of no event: far from one
    body.event = NO_EVENT
    if body.coulomb:
        if body.mode != DOUBLE:
            value = touch_witness(body)
        return grip_witness(body, value) if body.watched else value
    if body.mode == DOUBLE:
        on_feet(body, 0.0, 1)
        if free_to_leave(body, body.outer):
            value = body.outer.Fy
            body.event = LIFT_OFF
            body.event_leg = body.outer
        if body.inner.Fy < value and free_to_leave(body, body.inner):
            value = body.inner.Fy
            body.event = LIFT_OFF
            body.event_leg = body.inner
        return value
    return touch_witness(body)


@cython.cfunc
@cython.exceptval(check=False)
def touch_witness(body: "Body") -> cython.double:
    """The witness of a foot in the air: its clearance, m."""
    value: cython.double
    if body.mode == SINGLE:
        value = clearance(body.swing)
        # only a foot ahead can strike; next to and behind the other it brushes with its sole
        if value < 0.0 and body.ahead() <= body.strike_ahead:
            return 1.0
        body.event = TOUCH
        body.event_leg = body.swing
        return value
    body.event = TOUCH
    body.event_leg = body.inner if clearance(body.inner) < clearance(body.outer) else body.outer
    return clearance(body.event_leg)


@cython.cfunc
def try_piece(body: "Body", h: cython.double) -> cython.double:
    """The witness after a piece of `h` seconds from the saved state."""
    body.restore()
    move(body, h)
    return witness(body)


@cython.cfunc
def locate(body: "Body", h: cython.double) -> cython.double:
    """Time in (0, h] at which the witness falls through 0, within 1e-10 s (Illinois method)."""
    low: cython.double = 0.0
    high: cython.double = h
    middle: cython.double
    value: cython.double
    f_high: cython.double = witness(body)
    f_low: cython.double
    side: cython.longlong = 0
    tries: cython.longlong = 0
    body.restore()
    body.update_pose()
    f_low = witness(body)
    if f_low <= 0.0:
        # already behind at the start: it happens now
        return 0.0
    while high - low > 1e-10 and tries < MOST_TRIES:
        tries += 1
        middle = (low * f_high - high * f_low) / (f_high - f_low)
        if not low < middle < high:
            middle = 0.5 * (low + high)
        value = try_piece(body, middle)
        if value > 0.0:
            low = middle
            f_low = value
            if side == 1:
                f_high *= 0.5
            side = 1
        else:
            high = middle
            f_high = value
            if side == -1:
                f_low *= 0.5
            side = -1
        if value > -1e-13 and value <= 0.0:
            break
    try_piece(body, high)
    return high


@cython.cfunc
def act(body: "Body") -> None:
    """Handle the located event."""
    body.update_hip_rates()
    if body.event == TOUCH:
        touch(body, body.event_leg)
    elif body.event == LIFT_OFF:
        leave(body, body.event_leg)
    elif body.event == SLIDE or body.event == STICK:
        regrip(body)
