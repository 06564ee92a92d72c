"""The body walks by itself: small controllers with ideal currents, and the whole plant with its bridges.

What is asked of step length, time and power are bands around what robot.md P4, W1 and W2 report
for the same machines in other simulations, 15 % in length and time, because contact rules and feet differ.
"""

import dataclasses

import pytest

from ranger_sim.plant.mechanics.body import Body
from ranger_sim.plant.mechanics.floor import Floor
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.plant.ranger import RangerPlant
from ranger_sim.plant.walking.motion import advance
from tests.plant.walking.small_controllers import (
    STEP_S,
    ElectricWalker,
    PaperGait,
    RecordGait,
    Walker,
    electric_start,
    held_start,
    mid_stance_start,
)


def walked(walker, steps):
    start, energy = walker.seconds, walker.energy_J
    upright = walker.run(steps)
    return upright, walker.body.record, (walker.energy_J - energy) / (walker.seconds - start)


@pytest.mark.parametrize("foot_inertia", [0.0, 0.002])
def test_the_robust_gait_walks_a_hundred_steps(foot_inertia):
    body = Body(BodyParameters(foot_inertia_kg_m2=foot_inertia))
    mid_stance_start(body)
    upright, record, power = walked(Walker(body, PaperGait()), 100)
    assert upright, body.cause
    assert record.steps == 100 and record.counted == 95
    # robot.md P4: 0.598 s, 12.1 W without the boards' current clips and with massless feet
    assert record.mean_step_time_s() == pytest.approx(0.598, rel=0.05)
    assert record.mean_step_length_m() == pytest.approx(0.39, rel=0.05)
    assert 10.0 < power < 17.0
    assert record.step_length_deviation_m() < 1e-2
    assert record.distance_m == pytest.approx(100 * record.mean_step_length_m(), rel=0.02)


def test_the_robust_gait_repeats_itself_bit_for_bit():
    ends = []
    for _ in range(2):
        body = Body()
        mid_stance_start(body)
        Walker(body, PaperGait()).run(10)
        ends.append((body.outer.angle, body.inner.foot_rate, body.hip_x, body.record.strike_time_ns))
    assert ends[0] == ends[1]


@pytest.mark.parametrize(
    ("machines", "length", "seconds"),
    [(RecordGait.ROBUST, 0.40, 0.64), (RecordGait.RECORD, 0.35, 0.63)],
    ids=["robust changes", "record"],
)
def test_the_machines_of_2011_walk_massless_feet(machines, length, seconds):
    """robot.md W1, W2: 0.369 m, 0.636 s unchanged; 0.425 m, 0.645 s with the changes for massless feet."""
    body = Body(BodyParameters(foot_inertia_kg_m2=0.0, arc_heel_rad=-0.1))
    walker = Walker(body, RecordGait(machines))
    held_start(walker)
    upright, record, power = walked(walker, 60)
    assert upright, body.cause
    assert record.mean_step_length_m() == pytest.approx(length, rel=0.15)
    assert record.mean_step_time_s() == pytest.approx(seconds, rel=0.15)
    assert 8.0 < power < 15.0


@pytest.mark.parametrize(("seed", "steps"), [(1, 100), (2, 20)])
def test_the_whole_plant_walks_a_hundred_steps_on_its_bridges(seed, steps):
    plant = RangerPlant(seed=seed)
    walker = ElectricWalker(plant, RecordGait(RecordGait.ROBUST))
    electric_start(plant, walker)
    upright, record, power = walked(walker, steps)
    assert upright, plant.fall_cause
    assert plant.steps == steps
    # what the whole robot is asked to show: 0.35 m +/- 25 %, 0.60 s +/- 15 %, 6 to 15 W
    assert record.mean_step_length_m() == pytest.approx(0.35, rel=0.25)
    assert record.mean_step_time_s() == pytest.approx(0.60, rel=0.15)
    assert 6.0 < power < 15.0
    assert plant.battery_V > 24.0


def test_the_robust_gait_walks_on_a_rough_floor_and_down_a_slope():
    floor = Floor(slope_rad=0.005, roughness_m=0.001, seed=3)
    body = Body(BodyParameters(), floor)
    mid_stance_start(body)
    upright, record, _ = walked(Walker(body, PaperGait()), 60)
    assert upright, body.cause
    # heights differ from step to step, so lengths do
    assert record.step_length_deviation_m() > 1e-3


def test_a_robot_without_current_falls_forward_and_the_walk_ends_with_that():
    body = Body(dataclasses.replace(BodyParameters(), foot_inertia_kg_m2=0.002))
    mid_stance_start(body)

    class Dead:
        def tick(self, walker):
            walker.set_currents(0.0, 0.0, 0.0)

    walker = Walker(body, Dead())
    assert not walker.run(1000, 10.0)
    assert body.record.fell
    assert body.cause in ("fell forward", "fell backward", "legs split", "tripped")
    assert body.record.fall_cause == body.cause
    fallen = body.outer.angle
    advance(body, STEP_S)
    assert body.outer.angle == fallen and body.record.fall_time_ns > 0
