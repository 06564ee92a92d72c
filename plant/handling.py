"""What the operator does with the robot: puts it into a pose, holds it, lets it go."""

import cython

if not cython.compiled:
    from ranger_sim.plant.watch import fall


def place(body, outer_leg_rad: cython.double, hip_rad: cython.double) -> None:
    """Everything at rest in the operator's hands, feet square to their legs, the hip free."""
    body.leg_outer = outer_leg_rad
    body.leg_inner = outer_leg_rad - hip_rad
    body.foot_outer = body.leg_outer
    body.foot_inner = body.leg_inner
    body.motor_outer = 0.0
    body.motor_inner = 0.0
    body.foot_outer_rate = 0.0
    body.foot_inner_rate = 0.0
    body.leg_inner_rate = 0.0
    body.motor_outer_rate = 0.0
    body.motor_inner_rate = 0.0
    hold(body, outer_leg_rad)


def hold(body, outer_leg_rad: cython.double) -> None:
    """Lift the robot by its outer legs, which the operator keeps at this lean, motionless.

    The inner leg hangs at the hip and both feet hang free, so the motors move them; the hip is 50 mm higher
    than standing (chosen by us: feet turn free of the floor).
    """
    body.mode = 0
    body.stance = 0
    body.leg_outer = outer_leg_rad
    body.leg_outer_rate = 0.0
    body.hip_vx = 0.0
    body.hip_vy = 0.0
    body.lift()
    body.outer_Fx = 0.0
    body.outer_Fy = 0.0
    body.inner_Fx = 0.0
    body.inner_Fy = 0.0
    body.lock_hip = False
    body.standing = False
    body.cause = ""
    body.last_strike_leg = -1
    if body.Jf == 0.0:
        body.limp_foot(0)
        body.limp_foot(1)
    body.update_pose()


def hold_both(body, outer_leg_rad: cython.double, hip_rad: cython.double) -> None:
    """As `hold`, and the operator keeps the inner legs at this hip angle too."""
    body.leg_inner = outer_leg_rad - hip_rad
    body.leg_inner_rate = 0.0
    hold(body, outer_leg_rad)
    body.lock_hip = True


def hold_standing(body, outer_leg_rad: cython.double, hip_rad: cython.double, stance: cython.longlong = 0) -> None:
    """As `hold_both`, with the stance foot on the floor under the robot's weight, where it may roll.

    The hands guide the legs' angles only. They also damp the rolling; 2 N m s/rad, about critical for the
    0.08 kg m^2 that roll against the cable: chosen by us, so that a posture settles at once.
    """
    hold_both(body, outer_leg_rad, hip_rad)
    body.standing = True
    body.stance = stance
    body.height_outer = 0.0
    body.height_inner = 0.0
    body.anchor(stance)
    body.update_pose()


def release(
    body,
    outer_leg_rate: cython.double,
    stance: cython.longlong = 0,
    stance_foot_rate: cython.double = 0.0,
    hip_rate: cython.double = 0.0,
) -> None:
    """Set the stance foot on the floor as it is and let go, with these rates (rad/s).

    hip_rate: of h, inner legs forward. When the other foot would stand in the floor the walk ends at once
    with that as its cause.
    """
    body.mode = 1
    body.stance = stance
    body.leg_outer_rate = outer_leg_rate
    body.leg_inner_rate = outer_leg_rate - hip_rate
    if stance == 0:
        body.foot_outer_rate = stance_foot_rate
    else:
        body.foot_inner_rate = stance_foot_rate
    begin_walk(body)


def begin_walk(body) -> None:
    """Stand on the stance foot from here on: anchors, footholds and the record start anew."""
    first: cython.double = body.floor.first_height()
    body.mode = 1
    body.standing = False
    body.height_outer = first
    body.height_inner = first
    body.foothold_due = True
    body.last_strike_leg = body.stance
    body.anchor_outer = 0.0
    body.anchor_inner = 0.0
    body.anchor(body.stance)
    if body.Jf == 0.0:
        body.limp_foot(1 - body.stance)
    body.update_pose()
    body.update_hip_rates()
    body.outer_armed = body.gap_outer > 1e-6
    body.inner_armed = body.gap_inner > 1e-6
    body.released_s = body.time_s
    body.scuff_time_s = -1.0
    body.passing_gap = 1.0
    body.friction_ratio_max = 0.0
    body.slip_s = 0.0
    body.normal_force_min = 0.0
    body.pull_s = 0.0
    body.brush = False
    body.brushing = False
    body.brush_s = 0.0
    body.cause = ""
    body.record.begin(body.step_start_ns, body.contact_x(body.stance))
    body.changes += 1
    if (body.gap_inner if body.stance == 0 else body.gap_outer) < 0.0:
        fall(body, "put down with the swing foot in the floor")
