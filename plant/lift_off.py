"""A foot leaves the floor: which one may, whether it would, and that it does (EQUATIONS 9)."""

import cython

if not cython.compiled:
    from math import cos, sin

    from ranger_sim.plant.air import in_air
    from ranger_sim.plant.stance import on_feet


def may_leave(body, leg: cython.longlong) -> cython.bint:
    """Feet on the floor may leave it; the leading one in double stance only with `lift_leading`."""
    if body.mode == 1:
        return leg == body.stance
    return body.lift_leading or leg != body.last_strike_leg


def sole_ready(body, leg: cython.longlong) -> cython.bint:
    """True when this foot of a double stance is not ahead: let go, its sole stops it from driving in."""
    if body.mode != 2 or body.Jf == 0.0:
        return False
    return body.behind(1 - leg) - body.behind(leg) < body.strike_ahead


def lets_go(body, leg: cython.longlong) -> cython.bint:
    """True when this foot, let go by the floor now, would rise: only then may it leave (EQUATIONS 9).

    A rigid foot that sticks can ask for a pull and yet, let go, drive into the floor, because letting go also
    takes the friction force away; on the robot it would slip there. It stays, and the pull is reported.
    """
    mode: cython.longlong = body.mode
    stance: cython.longlong = body.stance
    fo: cython.double = body.foot_outer
    fi: cython.double = body.foot_inner
    fo_rate: cython.double = body.foot_outer_rate
    fi_rate: cython.double = body.foot_inner_rate
    outer_Fx: cython.double = body.outer_Fx
    outer_Fy: cython.double = body.outer_Fy
    inner_Fx: cython.double = body.inner_Fx
    inner_Fy: cython.double = body.inner_Fy
    gap: cython.double
    away: cython.double
    if mode == 2:
        body.mode = 1
        body.stance = 1 - leg
    else:
        body.mode = 3
    if body.Jf == 0.0:
        body.limp_foot(leg)
    body.update_pose()
    gap = body.gap_outer if leg == 0 else body.gap_inner
    if body.mode == 1:
        on_feet(body, 0.0, 1)
        away = rise(body, 1 - leg) - rise(body, leg)
    else:
        in_air(body, 0.0, 1)
        away = body.hip_ay - rise(body, leg)
    body.mode = mode
    body.stance = stance
    body.foot_outer = fo
    body.foot_inner = fi
    body.foot_outer_rate = fo_rate
    body.foot_inner_rate = fi_rate
    body.outer_Fx = outer_Fx
    body.outer_Fy = outer_Fy
    body.inner_Fx = inner_Fx
    body.inner_Fy = inner_Fy
    body.update_pose()
    # a massless foot turns to its motor's angle at once and may come clear, or down, by that alone
    if gap > 1e-9:
        return True
    return gap > -1e-9 and away > 0.0


def rise(body, leg: cython.longlong) -> cython.double:
    """Vertical acceleration of a chain's hip end over a resting contact: f foot'' - l sin leg'' + bias."""
    foot: cython.double = body.foot_outer if leg == 0 else body.foot_inner
    lean: cython.double = body.leg_outer if leg == 0 else body.leg_inner
    foot_rate: cython.double = body.foot_outer_rate if leg == 0 else body.foot_inner_rate
    leg_rate: cython.double = body.leg_outer_rate if leg == 0 else body.leg_inner_rate
    foot_acc: cython.double = body.foot_outer_acc if leg == 0 else body.foot_inner_acc
    leg_acc: cython.double = body.leg_outer_acc if leg == 0 else body.leg_inner_acc
    excess: cython.double = body.excess(foot)
    down: cython.double = body.d * cos(foot)
    if excess != 0.0:
        down -= body.r * cos(excess)
    return (
        (body.d * sin(foot) - body.r * sin(excess)) * foot_acc
        - body.el * sin(lean) * leg_acc
        + down * foot_rate * foot_rate
        - body.el * cos(lean) * leg_rate * leg_rate
    )


def leave(body, foot: cython.longlong) -> None:
    """The foot goes off the floor; the other one carries, or none does."""
    if foot == 0:
        body.outer_armed = False
    else:
        body.inner_armed = False
    body.update_hip_rates()
    if body.mode == 2:
        body.mode = 1
        body.stance = 1 - foot
        body.brush = body.ahead() <= body.strike_ahead
        body.brushing = True  # it leaves: only a later touch counts as one
    else:
        body.mode = 3
    if body.Jf == 0.0:
        body.limp_foot(foot)
        if body.mode == 3:
            body.limp_foot(1 - foot)
    body.update_pose()
    body.record.leave(body.event_time_ns(), foot, body.mode == 3)
    body.changes += 1
