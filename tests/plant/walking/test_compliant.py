"""A floor that gives: known answers of its spring, its damper and its friction, and a walk on it."""

import math

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.mechanics.body import SINGLE
from ranger_sim.plant.mechanics.leg import INNER, OUTER
from ranger_sim.plant.mechanics.parameters import BodyParameters
from tests.plant.mechanics.test_sliding import G, run, walk
from tests.plant.walking.small_controllers import STEP_S
from tests.plant.walking.test_strike import frame


def block(height=0.0, mu=0.4, stance=OUTER):
    """A frame whose legs are too heavy to turn, so many metres above the floor; the other foot is over a hole."""
    body = frame(mu, inertia=1e12, contact="compliant")
    body.mode = SINGLE
    body.stand_on(body.leg(stance))
    body.swing.height = -1.0
    body.anchor_foot(body.stance)
    body.update_pose()
    body.floating = body.sliding = True
    body.hip_y += height
    body.update_pose()
    return body


@pytest.mark.parametrize("stance", [OUTER, INNER])
def test_a_block_sinks_by_its_weight_over_the_stiffness(stance):
    body = block(stance=stance)
    run(body, 0.8)
    # damping of k a d^2 has no linear part: what swings decays as 1 / t, to some per cent of a millimetre
    assert body.stance.gap == pytest.approx(-body.M * G / 1e5, rel=0.1)
    assert body.stance.Fx == pytest.approx(0.0, abs=1e-9)


def test_a_dropped_block_loses_energy_only_and_hardly_rebounds():
    """Hunt and Crossley: the damper acts only while it pushes. From 20 mm it comes down with 0.63 m/s."""
    body = block(height=0.02)
    energies, highest = [], 0.0
    fallen = False
    while body.time_s < 0.4:
        deep = max(0.0, -body.stance.gap)
        energies.append(0.5 * body.M * body.hip_vy**2 + body.M * G * body.hip_y + 0.5 * 1e5 * deep * deep)
        run(body, STEP_S)
        assert body.stance.Fy >= 0.0
        fallen |= body.stance.gap < 0.0
        if fallen:
            highest = max(highest, body.stance.gap)
    assert fallen
    # Runge and Kutta's error where the force jumps in its rate: 25 us of 600 N at 0.6 m/s
    assert all(b <= a + 1e-5 for a, b in zip(energies, energies[1:], strict=False))
    # a restitution of a quarter would give 1.2 mm
    assert highest < 1.2e-3
    assert body.record.touches == body.record.lift_offs  # it stood to begin with: put up there, it left at once


@pytest.mark.parametrize("downhill", [1, -1])
@pytest.mark.parametrize("share", [0.3, 0.9])
def test_on_a_slope_a_block_creeps_until_friction_balances(downhill, share):
    """mu N tanh(v / v_s) = M g sin: v = v_s atanh(tan / mu)."""
    mu = 0.4
    body = block(mu=mu)
    angle = math.atan(share * mu)
    body.set_slope(downhill * angle)
    run(body, 0.8)
    assert body.hip_vx == pytest.approx(downhill * 0.01 * math.atanh(share), rel=1e-2)


def test_beyond_the_angle_of_friction_it_slides():
    mu = 0.4
    body = block(mu=mu)
    angle = math.atan(1.5 * mu)
    body.set_slope(angle)
    run(body, 0.8)
    before = body.hip_vx
    run(body, 0.1)
    assert body.hip_vx - before == pytest.approx(0.1 * G * (math.sin(angle) - mu * math.cos(angle)), rel=0.02)


def test_a_walk_on_it_pulls_nowhere_and_keeps_within_friction():
    body, worst = walk(BodyParameters(contact="compliant"), steps=2)
    assert body.record.steps == 2
    assert worst.min() >= -1e-9
    assert body.record.touches == 2
    assert body.record.tensile_strikes == 0


def test_a_floor_softer_than_a_mattress_is_refused():
    with pytest.raises(UserError, match="floor_N_per_m"):
        BodyParameters(floor_N_per_m=10.0)
