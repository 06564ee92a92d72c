# cython: cdivision=True
# (only by forces above 5 N)
"""Checks once per step of a walk: feet clear of the floor, footholds, extremes of the forces, falls."""

import cython
from cython.cimports.libc.math import fabs

from ranger_sim.plant.mechanics.body import DOUBLE, FALLEN, FLIGHT, SINGLE, Body
from ranger_sim.plant.mechanics.leg import Leg
from ranger_sim.plant.mechanics.observed import Observed


@cython.ccall
def watch(body: "Body", h: cython.double) -> None:
    """Once per step of `h` seconds, while the robot walks."""
    arm(body.outer)
    arm(body.inner)
    if body.mode == SINGLE:
        watch_swing_foot(body, h)
    keep_forces(body, h)
    judge_fall(body)


@cython.cfunc
def arm(leg: "Leg") -> cython.void:
    """A foot that is clear of the floor can touch it again."""
    if not leg.armed and leg.gap > 1e-6:
        leg.armed = True


@cython.cfunc
def watch_swing_foot(body: "Body", h: cython.double) -> None:
    """Draw its next foothold, notice its sole on the floor, keep its lowest clearance."""
    seen: Observed = body.seen
    w: Leg = body.swing
    s: cython.double = body.stance.angle
    gap: cython.double = w.gap
    if seen.foothold_due and w is not body.last_strike and s > w.angle:
        # the swing ankle passes the stance ankle: from here its next foothold counts
        seen.foothold_due = False
        w.height = body.floor.next_height()
        body.update_pose()
    # near the floor and not ahead: the sole may touch in the next step
    body.brush = gap < 1e-3 and body.ahead() <= body.strike_ahead
    if gap < 0.0 and body.brush:
        seen.brush_s += h
        if not seen.brushing:
            seen.brushing = True
            body.record.brush(not seen.foothold_due)
            if not seen.foothold_due:
                seen.scuff_time_s = body.time_s
    elif gap > 1e-3:
        seen.brushing = False
    # clearance: the lowest gap while the swing foot is less than 50 mm from passing
    if gap < seen.passing_gap and -0.05 < body.stance.el * (s - w.angle) < 0.05:
        seen.passing_gap = gap


@cython.ccall
def keep_forces(body: "Body", h: cython.double) -> cython.void:
    """Worst friction ratio and pull of the walk; time with more than the floor's friction."""
    seen: Observed = body.seen
    least: cython.double = body.stance.Fy
    outer_slips: cython.bint = slips(body, body.outer)
    inner_slips: cython.bint = slips(body, body.inner)
    if outer_slips or inner_slips:
        seen.slip_s += h
    if body.mode == DOUBLE and body.swing.Fy < least:
        least = body.swing.Fy
    if body.mode == FLIGHT:
        least = 0.0
    elif least < seen.normal_force_min:
        seen.normal_force_min = least
    if least < -1.0:
        seen.pull_s += h


@cython.cfunc
@cython.exceptval(check=False)
def slips(body: "Body", leg: "Leg") -> cython.bint:
    """Whether this foot slides or needs more than the floor's friction; the worst friction ratio is kept."""
    along: cython.double = fabs(leg.Fx)
    if leg.slide != 0:
        body.seen.friction_ratio_max = max(body.seen.friction_ratio_max, body.sole.mu)
        return True
    if leg.Fy <= 5.0:  # N; below that the ratio is meaningless: chosen by us
        return False
    if along > body.seen.friction_ratio_max * leg.Fy:
        body.seen.friction_ratio_max = along / leg.Fy
    return along > body.sole.mu * leg.Fy


@cython.cfunc
def judge_fall(body: "Body") -> None:
    """End the walk when the robot lies, leans too far, splits its legs or stops (EQUATIONS 16)."""
    seen: Observed = body.seen
    s: cython.double = body.stance.angle
    w: cython.double = body.swing.angle
    if body.hip_y < seen.fall_height * body.stance.el or s > seen.fall_lean or s < -seen.fall_lean:
        if seen.scuff_time_s >= 0.0 and body.time_s - seen.scuff_time_s < 0.5:
            fall(body, "tripped")
        elif s > 0.0:
            fall(body, "fell forward")
        else:
            fall(body, "fell backward")
    elif s - w > seen.fall_split or w - s > seen.fall_split:
        fall(body, "legs split")
    elif body.time_s - seen.released_s > seen.stall_s:
        fall(body, "stalled")


@cython.ccall
def fall(body: "Body", cause) -> None:
    """The walk ends here: the body lies still, with the cause."""
    body.mode = FALLEN
    body.cause = cause
    body.record.fall(body.event_time_ns(), cause)
    body.changes += 1
    body.outer.lie()
    body.inner.lie()
    body.hip_vx = 0.0
    body.hip_vy = 0.0
