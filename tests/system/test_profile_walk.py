"""The robot walks on buses at 1 Mbit/s with their schedules (100 steps: `ranger-sim walk --profile hil-1mbit`)."""

import contextlib

from ranger_sim.harness.outside import profile
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule


def walked(chosen, steps):
    with contextlib.closing(Ranger(Scenario(), profile=chosen)) as robot:
        while not robot.run(StopRule(steps=steps), 10.0):
            pass
        return robot.summary()


def test_the_robot_walks_with_half_the_rates_at_a_third_of_the_speed():
    summary = walked(profile.load("hil-1mbit"), 8)
    assert summary["steps"] == 8 and not summary["fell"] and summary["failed_boards"] == []
    assert summary["profile"] == "hil-1mbit"
    for name, bus in summary["can"].items():
        assert bus["lost"] == bus["queue_full"] == 0, name
        assert bus["load_max"] < 0.6, name


def test_the_default_profile_changes_nothing():
    assert walked(profile.default(), 1)["trace_digest"] == walked(None, 1)["trace_digest"]
