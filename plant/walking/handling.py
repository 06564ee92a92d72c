"""Actions of the operator: puts the robot into a pose, holds it, lets it go."""

import cython

from ranger_sim.plant.mechanics.body import HELD, SINGLE, Body
from ranger_sim.plant.mechanics.leg import OUTER, Leg
from ranger_sim.plant.walking.watch import fall


@cython.ccall
def place(body: "Body", outer_leg_rad: cython.double, hip_rad: cython.double) -> None:
    """Put everything at rest in the operator's hands, feet square to their legs, the hip free."""
    leg: Leg
    body.outer.angle = outer_leg_rad
    body.inner.angle = outer_leg_rad - hip_rad
    for leg in (body.outer, body.inner):
        leg.foot_angle = leg.angle
        leg.motor_angle = 0.0
        leg.lie()
    hold(body, outer_leg_rad)


@cython.ccall
def hold(body: "Body", outer_leg_rad: cython.double) -> None:
    """Lift the robot by its outer legs, which the operator keeps at this lean, motionless.

    The inner leg hangs at the hip and both feet hang free, so the motors move them; the hip is 50 mm higher
    than standing (chosen by us: feet turn free of the floor).
    """
    leg: Leg
    body.mode = HELD
    body.stand_on(body.outer)
    body.outer.angle = outer_leg_rad
    body.outer.rate = 0.0
    body.hip_vx = 0.0
    body.hip_vy = 0.0
    body.lift()
    body.lock_hip = False
    body.standing = False
    body.sliding = False
    body.floating = False
    body.cause = ""
    body.last_strike = None
    for leg in (body.outer, body.inner):
        leg.Fx = 0.0
        leg.Fy = 0.0
        leg.slide = 0
        if leg.Jf == 0.0:
            leg.limp()
    body.update_pose()


@cython.ccall
def hold_both(body: "Body", outer_leg_rad: cython.double, hip_rad: cython.double) -> None:
    """As `hold`, but the operator also keeps the inner legs at this hip angle."""
    body.inner.angle = outer_leg_rad - hip_rad
    body.inner.rate = 0.0
    hold(body, outer_leg_rad)
    body.lock_hip = True


@cython.ccall
def hold_standing(
    body: "Body", outer_leg_rad: cython.double, hip_rad: cython.double, stance: cython.longlong = OUTER
) -> None:
    """As `hold_both`, with the stance foot on the floor under the robot's weight, where it may roll.

    The hands guide the legs' angles only. They also damp the rolling; 2 N m s/rad, about critical for the
    0.08 kg m^2 that roll against the cable: chosen by us, so that a posture settles at once.
    """
    hold_both(body, outer_leg_rad, hip_rad)
    body.standing = True
    body.stand_on(body.leg(stance))
    body.outer.height = 0.0
    body.inner.height = 0.0
    body.anchor_foot(body.stance)
    body.update_pose()


@cython.ccall
def release(
    body: "Body",
    outer_leg_rate: cython.double,
    stance: cython.longlong = OUTER,
    stance_foot_rate: cython.double = 0.0,
    hip_rate: cython.double = 0.0,
) -> None:
    """Set the stance foot on the floor in its present pose and let go, with these rates (rad/s).

    hip_rate: of h, inner legs forward. When the other foot would be inside the floor the walk ends at once with that as
    its cause.
    """
    body.mode = SINGLE
    body.stand_on(body.leg(stance))
    body.outer.rate = outer_leg_rate
    body.inner.rate = outer_leg_rate - hip_rate
    body.stance.foot_rate = stance_foot_rate
    begin_walk(body)


@cython.ccall
def begin_walk(body: "Body") -> None:
    """Stand on the stance foot from here on: anchors, footholds and the record restart."""
    first: cython.double = body.floor.first_height()
    leg: Leg
    body.mode = SINGLE
    body.standing = False
    body.sliding = False
    body.floating = False
    for leg in (body.outer, body.inner):
        leg.height = first
        leg.anchor = 0.0
        leg.slide = 0
    body.last_strike = body.stance
    body.anchor_foot(body.stance)
    if body.swing.Jf == 0.0:
        body.swing.limp()
    body.update_pose()
    body.update_hip_rates()
    body.sliding = body.floating = body.compliant
    for leg in (body.outer, body.inner):
        leg.armed = leg.gap > 1e-6
    body.brush = False
    body.cause = ""
    body.seen.begin(body.time_s)
    body.record.begin(body.step_start_ns, body.contact_x(body.stance))
    body.changes += 1
    if body.swing.gap < 0.0:
        fall(body, "put down with the swing foot in the floor")
