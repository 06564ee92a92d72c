"""Between strikes no foot is pulled nor held beyond friction: it slides, sticks again, or leaves."""

import math

import numpy as np
import pytest

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.plant.mechanics.air import in_air
from ranger_sim.plant.mechanics.body import DOUBLE, FALLEN, FLIGHT, SINGLE, Body
from ranger_sim.plant.mechanics.leg import INNER, OUTER
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.plant.mechanics.sliding import slide
from ranger_sim.plant.mechanics.stance import on_feet
from ranger_sim.plant.ranger import STEP_NS
from ranger_sim.plant.walking import motion
from tests.plant.mechanics.test_body_equations import (
    INERTIAL,
    Lagrange,
    accelerations,
    closed_posture,
    forces,
    set_motors,
    set_random_rates,
    to_body,
    to_z,
)
from tests.plant.walking.small_controllers import STEP_S, PaperGait, Walker, mid_stance_start
from tests.plant.walking.test_strike import frame

G = 9.81


# ---- a block: a frame whose legs are too heavy to turn ------------------------------------------------------------


def block(mu=0.4, stance=OUTER):
    """All of it slides or sticks as one, on one foot; the other foot is over a hole."""
    body = frame(mu, inertia=1e12)
    body.mode = SINGLE
    body.stand_on(body.leg(stance))
    body.swing.height = -1.0
    body.anchor_foot(body.stance)
    body.update_pose()
    return body


def run(body, seconds):
    for _ in range(round(seconds / STEP_S)):
        body.step_start_ns += STEP_NS
        motion.advance(body, STEP_S)


@pytest.mark.parametrize("stance", [OUTER, INNER])
@pytest.mark.parametrize("forwards", [1, -1])
def test_a_block_slides_to_rest_in_the_time_and_way_of_friction(forwards, stance):
    """v / (mu g) and v^2 / (2 mu g): to rounding, because the deceleration is constant."""
    mu, v = 0.4, 0.3
    body = block(mu, stance)
    body.hip_vx = forwards * v
    body.stance.slide, body.sliding = forwards, True
    start = body.hip_x
    lasts = v / (mu * G)  # 76.5 ms
    run(body, STEP_S * math.floor(lasts / STEP_S))
    assert body.stance.slide == forwards
    assert body.hip_vx == pytest.approx(forwards * (v - mu * G * body.time_s), abs=1e-12)
    run(body, 2 * STEP_S)
    assert body.stance.slide == 0 and not body.sliding
    # a slide ends 1e-9 m/s beyond rest
    assert body.hip_x - start == pytest.approx(forwards * v * v / (2 * mu * G), abs=1e-10)
    assert body.contact_x(body.stance) == pytest.approx(body.hip_x, abs=1e-12)
    assert body.stance.anchor == pytest.approx(body.hip_x, abs=1e-12)
    stopped = body.hip_x
    run(body, 0.05)
    assert body.hip_x == pytest.approx(stopped, abs=1e-12)
    assert body.record.slides == 0  # it did not begin to slide here


@pytest.mark.parametrize("downhill", [1, -1])
@pytest.mark.parametrize(("share", "slides"), [(0.99, False), (1.01, True)])
def test_a_block_on_a_slope_slides_beyond_the_angle_of_friction(downhill, share, slides):
    mu = 0.4
    body = block(mu)
    angle = math.atan(share * mu)
    body.set_slope(downhill * angle)
    start = body.hip_x
    run(body, 0.1)
    assert (body.stance.slide == downhill) == slides
    moved = 0.5 * G * (math.sin(angle) - mu * math.cos(angle)) * 0.1**2 if slides else 0.0
    assert body.hip_x - start == pytest.approx(downhill * moved, abs=1e-12)
    assert body.record.slides == slides
    assert body.stance.Fy == pytest.approx(body.M * G * math.cos(angle))
    assert body.stance.Fx == pytest.approx(-downhill * body.M * G * min(math.sin(angle), mu * math.cos(angle)))


@pytest.mark.parametrize("forwards", [1.0, -1.0])
def test_the_floor_lets_a_pendulum_go_where_its_height_is_two_thirds(forwards):
    """From rest at th0 a mass on a thin leg needs no floor from cos th = 2/3 cos th0 on: its push is N = M g (3 cos th
    - 2 cos th0) cos th along the leg. What stays on the floor, without a push, is the leg's foot.
    """
    body = frame(mu=3.0, inertia=1e-9)
    body.mode = SINGLE
    body.seen.fall_lean, body.seen.fall_height, body.seen.fall_split = 2.0, 0.0, 9.0
    body.outer.angle = forwards * 0.1
    body.swing.height = -1.0
    body.anchor_foot(body.stance)
    body.update_pose()
    while body.mode == SINGLE and not body.sliding:
        lean, push = body.outer.angle, body.outer.Fy
        run(body, STEP_S)
    expected = body.M * G * (3.0 * math.cos(lean) - 2.0 * math.cos(0.1)) * math.cos(lean)
    assert push == pytest.approx(expected, abs=1e-6) and 0.0 < push < 1.0
    assert forwards * lean < math.acos(2.0 / 3.0 * math.cos(0.1)) < forwards * body.outer.angle
    run(body, 0.05)
    assert body.stance.Fy == pytest.approx(0.0, abs=1e-6)
    # from here on the mass falls freely
    falls = body.hip_vy
    run(body, 0.01)
    assert body.hip_vy - falls == pytest.approx(-G * 0.01, rel=1e-6)


# ---- against the closed forms, and against numerical Lagrange -----------------------------------------------------


@pytest.mark.parametrize("stance", [OUTER, INNER])
def test_without_a_slide_the_ten_equations_give_the_closed_forms(stance):
    """Single and double stance of `on_feet`, flight of `in_air`: accelerations and forces."""
    stream = RandomStream(stance, "ten equations")
    for mode in (SINGLE, DOUBLE, FLIGHT):
        for _ in range(20):
            body = Body(INERTIAL)
            set_motors(body, stream)
            closed_posture(body, stream, stance)
            body.mode = mode
            if mode != DOUBLE:
                set_random_rates(body, stream)
                if mode == FLIGHT:
                    body.hip_vx, body.hip_vy = stream.normal(), stream.normal()
            body.update_hip_rates()
            (in_air if mode == FLIGHT else on_feet)(body, 0.0, 1)
            want, push = accelerations(body), forces(body)
            slide(body, 0.0, 1)
            # both solve systems with condition numbers up to 1e6
            assert accelerations(body) == pytest.approx(want, abs=1e-9 * np.abs(want).max())
            for side in (OUTER, INNER):
                assert forces(body)[side] == pytest.approx(push[side], abs=1e-8 * max(1.0, np.abs(want).max()))


def lagrange_sliding(p, z, zd, laws, ways, mu):
    """Accelerations and forces (x, y by foot) with feet that slide one way (1, -1) or stick (0); by their side."""
    other = Lagrange(p)
    J = other.jacobian(other.coordinates, z)
    mass = J.T @ (other.weights(z)[:, None] * J)
    free, _ = other.solve(z, zd, laws, ())
    load = mass @ free
    rows, columns, c = [], [], []
    for foot, way in ways.items():
        load[4 + foot] -= (p.outer_rolling_friction_Nms, p.inner_rolling_friction_Nms)[foot] * zd[4 + foot]
        A = other.jacobian(other.contact(foot), z)
        bend = other.curvature(other.contact(foot), z, zd)
        if way == 0:
            rows += [A[0], A[1]]
            columns += [A[0], A[1]]
            c += [-bend[0], -bend[1]]
        else:
            rows.append(A[1])
            columns.append(A[1] - way * mu * A[0])
            c.append(-bend[1])
    n = len(rows)
    system = np.block([[mass, -np.array(columns).T], [np.array(rows), np.zeros((n, n))]])
    x = np.linalg.solve(system, np.concatenate([load, c]))
    found, k = {}, 8
    for foot, way in ways.items():
        if way == 0:
            found[foot] = (x[k], x[k + 1])
            k += 2
        else:
            found[foot] = (-way * mu * x[k], x[k])
            k += 1
    return x[:8], found


@pytest.mark.parametrize("ways", [(1, None), (-1, None), (0, 1), (-1, 0), (1, -1), (-1, -1)])
@pytest.mark.parametrize("stance", [OUTER, INNER])
def test_sliding_feet_agree_with_numerical_lagrange(stance, ways):
    """`ways`: of the stance foot and of the other one, None in the air."""
    stream = RandomStream(stance, f"sliding {ways}")
    for _ in range(15):
        body = Body(INERTIAL)
        laws = set_motors(body, stream)
        closed_posture(body, stream, stance)  # both contacts at rest
        body.closing_rate = 0.0  # it would pull contacts that move
        for leg, way in zip((body.stance, body.swing), ways, strict=True):
            leg.slide = way or 0
        body.sliding = True
        if ways[1] is None:
            body.mode = SINGLE
            body.swing.angle -= 0.1
            body.swing.rate += 1.0
        if ways.count(0) == 0:
            body.hip_vx += ways[0] * 0.3  # along the floor; a foot that sticks has none
        body.update_pose()
        z, zd = to_z(body)
        feet = {leg.side: way for leg, way in zip((body.stance, body.swing), ways, strict=True) if way is not None}
        want, push = lagrange_sliding(INERTIAL, z, zd, laws, feet, INERTIAL.floor_friction)
        slide(body, 0.0, 1)
        # curvatures by differences of 1e-5: 1e-9 of rates up to 10, in systems of condition 1e5
        assert accelerations(body) == pytest.approx(to_body(want), rel=1e-6, abs=1e-6 * np.abs(want).max())
        for foot, force in push.items():
            assert forces(body)[foot] == pytest.approx(force, rel=1e-6, abs=1e-5 * max(1.0, np.abs(want).max()))


@pytest.mark.parametrize("way", [1, -1])
def test_a_sliding_foot_takes_the_work_of_its_friction(way):
    """Energy before less energy after is the integral of mu N |v|; nothing else dissipates here."""
    p = BodyParameters(
        outer_rolling_friction_Nms=0.0,
        inner_rolling_friction_Nms=0.0,
        floor_friction=0.1,
        foot_inertia_kg_m2=0.05,  # so that friction does not whirl it round
        contact="coulomb",
    )
    body = Body(p)
    mid_stance_start(body, leg_rate=0.3, hip_rate=0.5)
    body.inner.height = -1.0
    body.stance.slide, body.sliding = way, True
    body.hip_vx += way * 1.0
    body.update_pose()
    before, work = body.energy_J(), 0.0
    for _ in range(40):
        slide(body, 0.0, 1)
        power = [p.floor_friction * body.stance.Fy * way * body.slip_m_per_s(body.stance)]
        for _ in range(2):
            slide(body, 0.5 * STEP_S, 4)
            slide(body, 0.0, 1)
            power.append(p.floor_friction * body.stance.Fy * way * body.slip_m_per_s(body.stance))
        work += STEP_S / 6.0 * (power[0] + 4.0 * power[1] + power[2])  # Simpson
    assert work > 0.05
    assert way * body.slip_m_per_s(body.stance) > 0.05
    # Runge-Kutta and Simpson at 250 us with 17 Hz: (2 pi 17 h)^4 = 5e-7 of what swings
    assert before - body.energy_J() == pytest.approx(work, rel=1e-7)


# ---- walks --------------------------------------------------------------------------------------------------------


def walk(parameters, steps=12):
    body = Body(parameters)
    mid_stance_start(body)
    walker = Walker(body, PaperGait())
    worst = []
    while body.record.steps < steps and body.mode != FALLEN:
        walker.run(steps, walker.seconds + 0.5 * STEP_S)
        for leg in (body.outer, body.inner):
            worst.append((leg.Fy, parameters.floor_friction * leg.Fy - abs(leg.Fx)))
    return body, np.array(worst)


@pytest.mark.parametrize(("mu", "inertia"), [(0.9, 0.002), (0.9, 0.0), (0.4, 0.002)])
def test_no_foot_pulls_or_holds_beyond_friction_in_a_walk(mu, inertia):
    """On a slippery floor too, where it slides. On a good one each step has one touch, massless feet as well."""
    body, worst = walk(BodyParameters(floor_friction=mu, contact="coulomb", foot_inertia_kg_m2=inertia))
    record = body.record
    assert record.steps == 12
    assert worst.min() > -1e-9  # N: a sliding foot is at the bound, to rounding
    assert record.tensile_strikes == 0 and record.tensile_impulse_min_Ns == 0.0
    if mu == 0.9:
        assert record.bounces == record.recontacts == record.jams == record.slides == 0
    else:
        assert record.slides > 0


def test_the_sticking_contact_of_the_same_walk_pulls_and_holds_beyond_friction():
    """What the test above would see if it looked at the old contact."""
    body, worst = walk(BodyParameters(floor_friction=0.25))
    assert body.record.tensile_strikes >= 10
    assert worst[:, 1].min() < -5.0
