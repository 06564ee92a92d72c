"""A step of the body against steps of its own accelerations, and terms of a model file against drives that do the same.

`test_body_equations.py` holds the accelerations at one time against two other derivations. Here they are
asked for at times only, and Nystrom's method of EQUATIONS 15 is written down again around them, with steps so short
that it is exact: what a whole step makes of them must be that.
"""

import dataclasses
import math

import numpy as np
import pytest

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.plant import terms
from ranger_sim.plant.mechanics.air import in_air
from ranger_sim.plant.mechanics.body import DOUBLE, FLIGHT, HELD, SINGLE, Body
from ranger_sim.plant.mechanics.floor import Floor
from ranger_sim.plant.mechanics.leg import INNER, OUTER
from ranger_sim.plant.mechanics.sliding import slide
from ranger_sim.plant.mechanics.stance import on_feet
from ranger_sim.plant.mechanics.term_torques import TermTorques
from ranger_sim.plant.ranger import STEP_NS
from ranger_sim.plant.walking import handling
from tests.plant.mechanics.test_body_equations import (
    INERTIAL,
    accelerations,
    closed_posture,
    random_posture,
    set_motors,
    set_state,
    state,
)

STEP_S = STEP_NS * 1e-9
PIECES = 16  # of a step, for what counts as exact: the error falls with the fourth power, by 65,536
# friction is smooth over the rates that a step brings: of what turns round within one, no step of this length knows
SMOOTH = dataclasses.replace(INERTIAL, friction_smoothing_rad_s=10.0)
MASSLESS = dataclasses.replace(SMOOTH, foot_inertia_kg_m2=0.0)
LONG_ARC = dataclasses.replace(SMOOTH, arc_heel_rad=-1.0, arc_toe_rad=2.0)


def look(body):
    """Accelerations at this time, of angles as `state` has them."""
    if body.mode in (SINGLE, DOUBLE):
        on_feet(body, 0.0, 1)
    else:
        in_air(body, 0.0, 1)
    return accelerations(body)


def nystrom(body, q, u, h):
    """One step of EQUATIONS 15 from angles q with rates u; k4 as written."""

    def at(angles, rates):
        set_state(body, angles, rates)
        return look(body)

    k1 = at(q, u)
    middle = q + h / 2 * u + h * h / 8 * k1
    k2 = at(middle, u + h / 2 * k1)
    k3 = at(middle, u + h / 2 * k2)
    k4 = at(q + h * u + h * h / 2 * k3, u + h * k3)
    return q + h * u + h * h / 6 * (k1 + k2 + k3), u + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def follows(make, q, u, step, move):
    """One step of a body that `make` gives, from q and u, is what short ones add up to."""
    body = make()
    set_state(body, q, u)
    move(body, step, 4)
    found = state(body)
    other = make()
    for _ in range(PIECES):
        q, u = nystrom(other, q, u, step / PIECES)
    # accelerations reach 1e4 rad/s^2 (cable on rotor), their own rates 1e6 1/s^3: a wrong share of a stage shows by
    # h^2 x 1e6 / 48 = 1e-3 rad/s and more; the step's own error was 5e-5 rad/s at most, in the stops of the ankles
    assert found[0] == pytest.approx(q, abs=2e-8)
    assert found[1] == pytest.approx(u, abs=1e-4)
    return body, other


@pytest.mark.parametrize("stance", [OUTER, INNER])
@pytest.mark.parametrize("foot", [-0.6, 0.1, 1.3], ids=["heel end", "arc", "toe end"])
@pytest.mark.parametrize("swing", ["free", "brushing", "massless", "low stop", "high stop"])
def test_a_step_on_one_foot_is_nystroms(stance, foot, swing):
    p = MASSLESS if swing == "massless" else SMOOTH
    stream = RandomStream(stance, f"step {foot} {swing}")
    for number in range(4):
        x, v = random_posture(stream), np.array([stream.normal() for _ in range(6)])
        s, w, leg, motor = (0, 3, 2, 5) if stance == OUTER else (3, 0, 1, 4)
        x[s] = foot + 0.02 * stream.normal()
        if swing.endswith("stop"):
            x[w] = x[leg] + (-1.75 if swing == "low stop" else 1.6)
        if swing == "massless":
            x[w], v[w] = x[leg] + x[motor], v[leg] + v[motor]

        def make(x=x, v=v, laws=number):
            body = Body(p, Floor(INERTIAL.slope_rad))
            set_motors(body, RandomStream(laws, "laws"))
            set_state(body, x, v)
            body.mode = SINGLE
            body.stand_on(body.leg(stance))
            body.update_pose()
            if swing == "brushing":
                body.brush = True
                body.swing.height = body.swing.gap + body.swing.height + 0.002  # 2 mm deep
                body.update_pose()
            return body

        body, _ = follows(make, x, v, STEP_S, on_feet)
        reported = body.hip_x, body.hip_y, body.swing.gap, body.stance.gap
        body.update_pose()
        assert reported == pytest.approx((body.hip_x, body.hip_y, body.swing.gap, 0.0), abs=1e-12)


@pytest.mark.parametrize("stance", [OUTER, INNER])
@pytest.mark.parametrize("p", [SMOOTH, LONG_ARC], ids=["own arcs", "long arcs"])
def test_a_step_on_two_feet_is_nystroms(stance, p):
    for seed in range(6):

        def make(seed=seed):
            stream = RandomStream(seed, "two feet")
            body = Body(p, Floor(p.slope_rad))
            set_motors(body, stream)
            closed_posture(body, stream, stance)
            return body

        follows(make, *state(make()), STEP_S / 4, on_feet)


@pytest.mark.parametrize("p", [SMOOTH, MASSLESS], ids=["feet", "massless feet"])
@pytest.mark.parametrize("ankle", [-1.75, 0.3, 1.6], ids=["low stop", "free", "high stop"])
def test_a_step_in_the_air_is_nystroms(p, ankle):
    stream = RandomStream(1, f"air {ankle}")
    for number in range(4):
        x, v = random_posture(stream), np.array([2 * stream.normal() for _ in range(6)])
        for foot, leg, motor in ((0, 1, 4), (3, 2, 5)):
            x[foot] = x[leg] + ankle
            x[motor] = ankle + 0.01 * stream.normal()
            if p is MASSLESS:
                x[foot], v[foot] = x[leg] + x[motor], v[leg] + v[motor]

        def make(x=x, v=v, laws=number):
            body = Body(p, Floor(p.slope_rad))
            set_motors(body, RandomStream(laws, "laws"))
            set_state(body, x, v)
            body.mode = FLIGHT
            body.hip_x, body.hip_y, body.hip_vx, body.hip_vy = 0.3, 1.1, 0.7, -0.4
            body.update_pose()
            return body

        body, _ = follows(make, x, v, STEP_S, in_air)
        # the centre of mass falls freely: its second difference over a step is gravity, whatever the legs do
        start = make()
        assert body_centre(body)[0] == pytest.approx(
            [
                at + STEP_S * rate + STEP_S**2 / 2 * g
                for at, rate, g in zip(*body_centre(start), (start.gx, start.gy), strict=True)
            ],
            abs=1e-11,
        )
        assert body_centre(body)[1] == pytest.approx(
            [rate + STEP_S * g for rate, g in zip(body_centre(start)[1], (start.gx, start.gy), strict=True)], abs=1e-7
        )


def body_centre(body):
    """(place, velocity) of the centre of mass, from each leg's first moments about the hip."""
    x, y, vx, vy = body.hip_x, body.hip_y, body.hip_vx, body.hip_vy
    for leg in (body.outer, body.inner):
        sine, cosine = math.sin(leg.angle), math.cos(leg.angle)
        x += (-leg.mc * sine + leg.mw * cosine) / body.M
        y += (-leg.mc * cosine - leg.mw * sine) / body.M
        vx += (-leg.mc * cosine - leg.mw * sine) * leg.rate / body.M
        vy += (leg.mc * sine - leg.mw * cosine) * leg.rate / body.M
    return (x, y), (vx, vy)


@pytest.mark.parametrize("p", [SMOOTH, MASSLESS], ids=["feet", "massless feet"])
@pytest.mark.parametrize("how", ["by one leg", "by both", "standing on the outer", "standing on the inner"])
def test_a_step_in_the_operators_hands_is_nystroms_and_what_is_held_rests(p, how):
    for seed in range(4):

        def make(seed=seed):
            stream = RandomStream(seed, "hands")
            body = Body(p, Floor(p.slope_rad))
            handling.place(body, 0.1, 0.25)
            if how == "by both":
                handling.hold_both(body, 0.1, 0.25)
            elif how.startswith("standing"):
                handling.hold_standing(body, 0.1, 0.25, OUTER if how.endswith("outer") else INNER)
            assert body.mode == HELD
            set_motors(body, stream)
            for leg in (body.outer, body.inner):
                leg.motor_angle, leg.motor_rate = 0.2 * stream.normal(), stream.normal()
                leg.foot_angle += 0.1 * stream.normal()
                if p is MASSLESS and not (body.standing and leg is body.stance):
                    leg.limp()
            if how == "by one leg":
                body.inner.rate = stream.normal()
            return body

        q, u = state(make())
        body, _ = follows(make, q, u, STEP_S, in_air)
        held = ("outer",) if how == "by one leg" else ("outer", "inner")
        for name in held:
            before = getattr(make(), name)
            assert (getattr(body, name).angle, getattr(body, name).rate) == (before.angle, 0.0)
        if body.standing:  # the weight, along the floor and on it, is on that foot
            weight = p.total_mass_kg * p.gravity_m_per_s2
            along, on = -weight * math.sin(p.slope_rad), weight * math.cos(p.slope_rad)
            assert (body.stance.Fx, body.stance.Fy) == pytest.approx((along, on), rel=1e-12)
            assert (body.swing.Fx, body.swing.Fy) == (0.0, 0.0)
        else:
            assert [(leg.Fx, leg.Fy) for leg in (body.outer, body.inner)] == [(0.0, 0.0)] * 2


# ---- terms of a model file


def with_term(body, at, change_Nms):
    """The body with a viscous term at a place."""
    model = terms.Model([dict(form="viscous_friction", at=at, change_Nms=change_Nms)])
    body.terms = TermTorques(0.0, 66.0, 34.0, 0.05)
    for term in model.terms:
        body.terms.add(term.form.torque, *terms.ROW_PLACES[at], list(term.values.values()))


def placed(mode, p, seed):
    """A body in a mode, moving."""
    stream = RandomStream(seed, "terms")
    body = Body(p, Floor(p.slope_rad))
    set_motors(body, stream)
    if mode == DOUBLE:
        closed_posture(body, stream, OUTER)
    else:
        set_state(body, random_posture(stream), [stream.normal() for _ in range(6)])
        body.mode = mode
        body.stand_on(body.leg(seed % 2))
        for leg in (body.outer, body.inner):
            if p is MASSLESS and not (mode == SINGLE and leg is body.stance):
                leg.limp()
        body.update_pose()
    return body


@pytest.mark.parametrize("mode", [SINGLE, DOUBLE, FLIGHT, HELD])
@pytest.mark.parametrize("p", [SMOOTH, MASSLESS], ids=["feet", "massless feet"])
@pytest.mark.parametrize("at", ["hip_joint", "outer_motor", "inner_motor", "outer_ankle", "inner_ankle"])
def test_a_term_does_what_a_drive_of_its_torque_does(mode, p, at):
    """At an ankle: a cable that is longer by torque / stiffness pulls so, and its motor is spared the rest.

    What a massless foot in the air is given, the cable hands on to its motor.
    """
    if mode == DOUBLE and p is MASSLESS:
        return  # feet on the floor: as with inertia
    for seed in range(4):
        body = placed(mode, p, seed)
        leg = body.outer if at.startswith("outer") else body.inner
        rates = {"joint": body.hip_rate(), "motor": leg.motor_rate, "ankle": leg.foot_rate - leg.rate}
        torque = -0.7 * rates[at.partition("_")[2]]
        with_term(body, at, 0.7)
        found = look(body)
        other = placed(mode, p, seed)
        same = other.outer if at.startswith("outer") else other.inner
        if at == "hip_joint":
            other.hip.drive += torque
        elif at.endswith("motor"):
            same.drive += torque
        elif p is MASSLESS and not (mode == SINGLE and same is other.stance):
            same.drive += torque
        else:
            same.motor_angle += torque / other.ankle.k
            same.drive += torque
        assert found == pytest.approx(look(other), rel=1e-9, abs=1e-7)
        assert np.abs(found - look(placed(mode, p, seed))).max() > 1e-3 * abs(torque)  # it does act


# ---- feet that slide


@pytest.mark.parametrize("ways", [(1, None), (-1, None), (0, 1), (-1, 0), (1, -1), (-1, -1)])
@pytest.mark.parametrize("stance", [OUTER, INNER])
def test_a_step_with_sliding_feet_is_as_exact_as_sixteen_short_ones(stance, ways):
    """`ways`: of the stance foot and of the other one, None in the air. A wrong share of a stage errs by h, not h^5."""
    for seed in range(3):

        def make(seed=seed):
            stream = RandomStream(seed, f"sliding step {ways}")
            body = Body(SMOOTH)
            set_motors(body, stream)
            closed_posture(body, stream, stance)
            body.closing_rate = 0.0  # it would pull contacts that move
            for leg, way in zip((body.stance, body.swing), ways, strict=True):
                leg.slide = way or 0
            body.sliding = True
            if ways[1] is None:
                body.mode = SINGLE
                body.swing.angle -= 0.1
            if ways.count(0) == 0:
                body.hip_vx += ways[0] * 0.3
            body.update_pose()
            return body

        step = STEP_S / 4
        whole, pieces, coarse = make(), make(), make()
        slide(whole, step, 4)
        for _ in range(PIECES):
            slide(pieces, step / PIECES, 4)
        found, exact = everything(whole), everything(pieces)
        # two feet that slide apart whirl with 1e5 rad/s^2; a wrong share of a stage shows by 1e-3 of that x h
        assert found == pytest.approx(exact, rel=3e-5, abs=1e-6)
        # and they move as the accelerations at the begin say, to first order in the step
        slide(coarse, 0.0, 1)
        acc, (q, u) = accelerations(coarse), state(coarse)
        short = 1e-7
        slide(coarse, short, 4)
        assert state(coarse)[0] == pytest.approx(q + short * u, abs=1e-9)
        assert (state(coarse)[1] - u) / short == pytest.approx(acc, rel=1e-3, abs=1.0)


def everything(body):
    """All angles, then the hip's place, all rates and the hip's."""
    q, u = state(body)
    return np.array([*q, body.hip_x, body.hip_y, *u, body.hip_vx, body.hip_vy])
