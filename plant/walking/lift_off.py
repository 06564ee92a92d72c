"""Lift-off of a foot: whether it may leave the floor, whether it would, and the lift-off itself (EQUATIONS 9)."""

import cython

from ranger_sim.plant.mechanics.air import in_air
from ranger_sim.plant.mechanics.body import DOUBLE, FLIGHT, SINGLE, Body
from ranger_sim.plant.mechanics.leg import Leg
from ranger_sim.plant.mechanics.stance import on_feet


@cython.cfunc
@cython.exceptval(check=False)
def may_leave(body: "Body", leg: "Leg") -> cython.bint:
    """Feet on the floor may leave it; the leading one in double stance only with `lift_leading`."""
    if body.mode == SINGLE:
        return leg is body.stance
    return body.lift_leading or leg is not body.last_strike


@cython.cfunc
@cython.exceptval(check=False)
def sole_ready(body: "Body", leg: "Leg") -> cython.bint:
    """True when this foot of a double stance is not ahead: let go, its sole stops it from driving in."""
    if body.mode != DOUBLE or leg.Jf == 0.0:
        return False
    return body.other(leg).behind() - leg.behind() < body.strike_ahead


@cython.ccall
def lets_go(body: "Body", leg: "Leg") -> cython.bint:
    """True when this foot, let go by the floor now, would rise: only then may it leave (EQUATIONS 9).

    A rigid foot that sticks can ask for a pull and yet, let go, drive into the floor, because letting go also
    takes the friction force away; on the robot it would slip there. It stays, and the pull is reported.
    """
    outer: Leg = body.outer
    inner: Leg = body.inner
    mode: cython.longlong = body.mode
    stance: Leg = body.stance
    foot_angle: cython.double = leg.foot_angle
    foot_rate: cython.double = leg.foot_rate
    outer_Fx: cython.double = outer.Fx
    outer_Fy: cython.double = outer.Fy
    inner_Fx: cython.double = inner.Fx
    inner_Fy: cython.double = inner.Fy
    gap: cython.double
    away: cython.double
    if mode == DOUBLE:
        body.mode = SINGLE
        body.stand_on(body.other(leg))
    else:
        body.mode = FLIGHT
    if leg.Jf == 0.0:
        leg.limp()
    body.update_pose()
    gap = leg.gap
    if body.mode == SINGLE:
        on_feet(body, 0.0, 1)
        away = body.stance.rise() - leg.rise()
    else:
        in_air(body, 0.0, 1)
        away = body.hip_ay - leg.rise()
    body.mode = mode
    body.stand_on(stance)
    leg.foot_angle = foot_angle
    leg.foot_rate = foot_rate
    outer.Fx = outer_Fx
    outer.Fy = outer_Fy
    inner.Fx = inner_Fx
    inner.Fy = inner_Fy
    body.update_pose()
    # a massless foot turns to its motor's angle at once and may come clear, or down, by that alone
    if gap > 1e-9:
        return True
    return gap > -1e-9 and away > 0.0


@cython.cfunc
def leave(body: "Body", leg: "Leg") -> None:
    """The leg's foot goes off the floor; the other one carries, or none does."""
    other: Leg = body.other(leg)
    leg.armed = False
    body.update_hip_rates()
    if body.mode == DOUBLE:
        body.mode = SINGLE
        body.stand_on(other)
        body.brush = body.ahead() <= body.strike_ahead
        body.seen.brushing = True  # it leaves: only a later touch counts as one
    else:
        body.mode = FLIGHT
    leg.slide = 0
    body.sliding = body.floating or (body.mode == SINGLE and other.slide != 0)
    if leg.Jf == 0.0:
        leg.limp()
    if body.mode == FLIGHT and other.Jf == 0.0:
        other.limp()
    body.update_pose()
    body.record.leave(body.event_time_ns(), leg.side, body.mode == FLIGHT)
    body.changes += 1
