"""A step on one or two feet (EQUATIONS 5, 6, 15)."""

import cython

from ranger_sim.plant.mechanics.body import DOUBLE, Body
from ranger_sim.plant.mechanics.leg import Leg
from ranger_sim.plant.mechanics.leg_motion import LegMotion
from ranger_sim.plant.mechanics.stance_equations import StanceEquations


@cython.ccall
@cython.exceptval(check=True)
def on_feet(body: "Body", h: cython.double, stages: cython.longlong) -> cython.void:
    """One Runge-Kutta-Nystrom step of `h` seconds in single or double stance; stages 4, or 1 to evaluate only.

    Accelerations and floor forces of the start of the step are left in the legs (EQUATIONS 5, 6), and with stages 4
    the state of its end with hip and gaps.
    """
    stance: Leg = body.stance
    equations: StanceEquations = body.stance_equations
    s: LegMotion = body.outer_motion if stance is body.outer else body.inner_motion
    w: LegMotion = body.inner_motion if stance is body.outer else body.outer_motion
    double_stance: cython.bint = body.mode == DOUBLE
    half: cython.double = 0.5 * h
    body.know_angles()
    equations.gx = body.gx
    equations.gy = body.gy
    equations.begin(s, w, double_stance, body.brush, body.terms)
    equations.set_geometry(False, False)
    equations.accelerate(0)
    equations.set_floor_forces()
    s.keep_accelerations()
    w.keep_accelerations()
    if stages == 1:
        return
    s.go_to_middle(h)
    w.go_to_middle(h)
    equations.hip_angle = s.th - w.th
    equations.set_geometry(True, False)
    equations.accelerate(1)
    s.set_rates(1, half)
    w.set_rates(1, half)
    equations.accelerate(2)
    s.go_to_end(h)
    w.go_to_end(h)
    equations.hip_angle = s.th - w.th
    if not double_stance:
        # the geometry of the step's end serves the next step as well
        s.take_angles_of_next_step(h)
        w.take_angles_of_next_step(h)
    equations.set_geometry(True, True)
    equations.accelerate(3)
    s.keep_sines()
    w.keep_sines()
    s.finish(h, True)
    w.finish(h, True)
    if double_stance:
        body.update_pose()
        return
    # EQUATIONS 4: the geometry of the fourth stage is that of the end; this is `update_pose` with the numbers at hand
    body.hip_x = stance.anchor + stance.r * (s.F - s.sigma) - s.f + s.l_sin
    body.hip_y = stance.height + s.e + s.l_cos
    stance.gap = 0.0
    w.leg.gap = equations.gap
