# cython: cdivision=True
# (only by a number of parts)
"""Motion on a floor that gives: no foot is held, none strikes (EQUATIONS 9)."""

from typing import Final

import cython

from ranger_sim.plant.mechanics.body import DOUBLE, FALLEN, FLIGHT, SINGLE, Body
from ranger_sim.plant.mechanics.leg import Leg
from ranger_sim.plant.mechanics.sliding import slide
from ranger_sim.plant.walking.lift_off import leave

# Parts of a step. Friction at 400 N stops a foot of 0.0012 kg m^2 54 mm below its ankle with a time constant of
# 11 us; Runge and Kutta's method is stable up to 2.8 times that, so 25 us. Chosen by us.
PARTS: Final = 10


@cython.cfunc
def press(body: "Body", h: cython.double) -> None:
    """Move on by `h` seconds; touches and lift-offs are noted to a part, 25 us."""
    part: cython.longlong
    outer: cython.double
    inner: cython.double
    step: cython.double = h / PARTS
    for part in range(PARTS):
        if body.mode == FALLEN:
            break
        outer = body.outer.gap
        inner = body.inner.gap
        slide(body, step, 4)
        body.elapsed = part * step
        meet(body, body.outer, outer)
        meet(body, body.inner, inner)


@cython.cfunc
def meet(body: "Body", leg: "Leg", before: cython.double) -> None:
    """Detect a touch or lift-off from the foot's gap `before` and its gap now."""
    other: Leg = body.other(leg)
    stands: cython.bint = body.mode == DOUBLE or (body.mode == SINGLE and leg is body.stance)
    ahead: cython.double = other.behind() - leg.behind()
    if stands and before <= 0.0 and leg.gap > 0.0:
        leave(body, leg)
    elif not stands and leg.gap < 0.0 and (body.mode == FLIGHT or ahead > body.strike_ahead):
        # next to and behind the standing foot it brushes: `watch` detects that
        stand(body, leg, ahead)


@cython.cfunc
def stand(body: "Body", leg: "Leg", ahead: cython.double) -> None:
    """This foot carries from here on; a step is counted when it has struck ahead."""
    strike: cython.bint = leg is not body.last_strike and ahead > body.strike_ahead
    body.mode = SINGLE if body.mode == FLIGHT else DOUBLE
    body.stand_on(leg)
    leg.armed = False
    body.record.touch(
        body.event_time_ns(),
        leg.side,
        strike,
        ahead,
        body.contact_x(leg),
        leg.foot_angle,
        (0.0, 0.0, 0.0, 0.0),
        0.0,
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
