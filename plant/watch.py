# cython: cdivision=True
# (only by forces above 5 N)
"""What is noticed once per step of a walk: feet clear of the floor, footholds, extremes of the forces, falls."""

import cython

if not cython.compiled:
    from math import fabs


def watch(body, h: cython.double) -> None:
    """Once per step of `h` seconds, while the robot walks."""
    if not body.outer_armed and body.gap_outer > 1e-6:
        body.outer_armed = True
    if not body.inner_armed and body.gap_inner > 1e-6:
        body.inner_armed = True
    if body.mode == 1:
        watch_swing_foot(body, h)
    keep_forces(body, h)
    judge_fall(body)


def watch_swing_foot(body, h: cython.double) -> None:
    """Draw its next foothold, notice its sole on the floor, keep its lowest clearance."""
    s: cython.double
    w: cython.double
    gap: cython.double
    if body.stance == 0:
        s, w, gap = body.leg_outer, body.leg_inner, body.gap_inner
    else:
        s, w, gap = body.leg_inner, body.leg_outer, body.gap_outer
    if body.foothold_due and 1 - body.stance != body.last_strike_leg and s > w:
        # the swing ankle passes the stance ankle: from here its next foothold counts
        body.foothold_due = False
        if body.stance == 0:
            body.height_inner = body.floor.next_height()
        else:
            body.height_outer = body.floor.next_height()
        body.update_pose()
    # near the floor and not ahead: the sole may touch in the next step
    body.brush = gap < 1e-3 and body.ahead() <= body.strike_ahead
    if gap < 0.0 and body.brush:
        body.brush_s += h
        if not body.brushing:
            body.brushing = True
            body.record.brush(not body.foothold_due)
            if not body.foothold_due:
                body.scuff_time_s = body.time_s
    elif gap > 1e-3:
        body.brushing = False
    # clearance: the lowest gap while the swing foot is less than 50 mm from passing
    if gap < body.passing_gap and -0.05 < body.el * (s - w) < 0.05:
        body.passing_gap = gap


def keep_forces(body, h: cython.double) -> cython.void:
    """Worst friction ratio and pull of the walk; time with more than the floor's friction."""
    outer: cython.double = body.outer_Fy
    inner: cython.double = body.inner_Fy
    outer_along: cython.double = fabs(body.outer_Fx)
    inner_along: cython.double = fabs(body.inner_Fx)
    least: cython.double = outer if outer < inner else inner
    slips: cython.bint = False
    if outer > 5.0:  # N; below that the ratio says nothing: chosen by us
        if outer_along > body.friction_ratio_max * outer:
            body.friction_ratio_max = outer_along / outer
        slips = outer_along > body.mu * outer
    if inner > 5.0:
        if inner_along > body.friction_ratio_max * inner:
            body.friction_ratio_max = inner_along / inner
        slips = slips or inner_along > body.mu * inner
    if slips:
        body.slip_s += h
    if least < body.normal_force_min:
        body.normal_force_min = least
    if least < -1.0:
        body.pull_s += h


def judge_fall(body) -> None:
    """The walk is over when the robot lies, leans too far, splits its legs or stands still (EQUATIONS 16)."""
    s: cython.double = body.leg_outer if body.stance == 0 else body.leg_inner
    w: cython.double = body.leg_inner if body.stance == 0 else body.leg_outer
    if body.hip_y < body.fall_height * body.el or s > body.fall_lean or s < -body.fall_lean:
        if body.scuff_time_s >= 0.0 and body.time_s - body.scuff_time_s < 0.5:
            fall(body, "tripped")
        elif s > 0.0:
            fall(body, "fell forward")
        else:
            fall(body, "fell backward")
    elif s - w > body.fall_split or w - s > body.fall_split:
        fall(body, "legs split")
    elif body.time_s - body.released_s > body.stall_s:
        fall(body, "stalled")


def fall(body, cause) -> None:
    """The walk ends here: the body lies still, with the cause."""
    body.mode = 4
    body.cause = cause
    body.record.fall(body.event_time_ns(), cause)
    body.changes += 1
    body.foot_outer_rate = 0.0
    body.leg_outer_rate = 0.0
    body.leg_inner_rate = 0.0
    body.foot_inner_rate = 0.0
    body.motor_outer_rate = 0.0
    body.motor_inner_rate = 0.0
    body.hip_vx = 0.0
    body.hip_vy = 0.0
    body.outer_Fx = 0.0
    body.outer_Fy = 0.0
    body.inner_Fx = 0.0
    body.inner_Fy = 0.0
