"""The robot walks because its boards talk; what it shows is held to the real robot's figures."""

import numpy as np
import pytest

from ranger_sim import datatable
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.schedule import scheduled_frames_per_s
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule

BUSES = ("can1", "can2", "can3", "can4")
# Frames/s: sync and what the boards send, robot.md N1.10.
UP_FRAMES_PER_S = {"can1": 1863.6, "can2": 955.6, "can3": 1955.6, "can4": 3750.0}
SYNC_FRAMES_PER_S = 1000.0


@pytest.fixture(scope="module")
def hundred_steps():
    robot = Ranger(Scenario(), log="window")
    while not robot.run(StopRule(steps=100), 1.0):
        pass
    return robot


def test_ranger_walks_a_hundred_steps_like_the_real_one(hundred_steps):
    summary = hundred_steps.summary()
    assert not summary["fell"], summary["fall_cause"]
    assert summary["steps"] == 100
    # bands of the project around the robot's 0.35 m, 0.60 s, 11.3 W, 0.28 (appendix 1)
    assert summary["mean_step_length_m"] == pytest.approx(0.35, rel=0.25)
    assert summary["mean_step_time_s"] == pytest.approx(0.60, rel=0.15)
    assert 6.0 <= summary["motor_power_W"] <= 15.0
    assert 0.19 <= summary["tcot"] <= 0.35
    assert summary["heel_strike_delay_ms"]["mean"] == pytest.approx(14.0, abs=6.0)


def test_the_record_walks_controller_unchanged_makes_the_robots_steps_on_the_robots_body(hundred_steps):
    summary = hundred_steps.summary()
    assert (summary["controller"], summary["body"]) == ("record-2011", "ranger")
    # appendix 1 and 4.3: 0.35 m, 0.60 s, 14 +/- 3 ms; seeds differ by up to 0.02 m and 0.03 s (docs/record-walk.md)
    assert summary["mean_step_length_m"] == pytest.approx(0.35, abs=0.02)
    assert summary["mean_step_time_s"] == pytest.approx(0.60, abs=0.03)
    assert summary["heel_strike_delay_ms"]["mean"] == pytest.approx(14.0, abs=2.0)
    # a floor neither pulls nor holds beyond friction
    assert summary["oddities"]["tensile_strikes"] == 0
    assert summary["oddities"]["friction_ratio_max"] <= 0.9 + 1e-9


def test_nothing_is_lost_and_every_slot_is_kept(hundred_steps):
    summary = hundred_steps.summary()
    assert {bus: summary["can"][bus]["lost"] for bus in BUSES} == dict.fromkeys(BUSES, 0)
    assert all(board["overruns"] == 0 for board in summary["slots"].values())
    assert not summary["failed_boards"]


def test_traffic_is_that_of_the_robots_tables(hundred_steps):
    frames = hundred_steps.logbook.frames()
    seconds = (frames["time_ns"][-1] - frames["time_ns"][0]) * 1e-9
    for number, bus in enumerate(BUSES):
        identifiers = frames["identifier"][frames["bus"] == number]
        publishers = np.array([all_variables.PUBLISHERS.get(int(i), "") for i in range(2048)])[identifiers]
        sync = np.count_nonzero(identifiers == 0) / seconds
        up = np.count_nonzero((publishers != "MB") & (publishers != "CSR")) / seconds
        assert sync == pytest.approx(SYNC_FRAMES_PER_S, rel=0.05)
        assert up == pytest.approx(UP_FRAMES_PER_S[bus], rel=0.05)


def test_total_load_is_that_of_our_schedules_and_controller(hundred_steps):
    # Up: what boards.toml says each board sends. Sync: one a millisecond. Down: the machines rewrite command current,
    # stiffness and dampness of hip and ankles in every slot of the main brain; steering and lights only on change.
    # A frame of 8 bytes has 108 bits, 3 of intermission and, with mixed contents, about 8 stuff bits (0 ... 24).
    table = datatable.load()
    slots_per_s = 1e6 / table.board("MB").slot_us
    commands = {"can1": 3, "can2": 0, "can3": 3, "can4": 3}
    summary = hundred_steps.summary()
    for bus in BUSES:
        frames = SYNC_FRAMES_PER_S + scheduled_frames_per_s(table, bus.upper()) + commands[bus] * slots_per_s
        assert summary["can"][bus]["load_mean"] == pytest.approx(frames * (108 + 3 + 8) / 3e6, rel=0.20), bus


def test_the_detection_chain_alone_takes_about_5_ms(walking):
    """From the foot's voltage crossing baseline + 2000 counts to the main brain's slot that flips the swing leg."""
    from ranger_sim.plant import wiring_points as point

    counts_per_volt = 8192 / 2.5
    robot, delays = walking, []
    crossed_at = None
    estimator = robot.board("MB").estimator
    swing = estimator.swing_leg
    feet = {
        1: (point.INNER_FOOT_LEFT, point.INNER_FOOT_RIGHT),
        0: (point.OUTER_FOOT_LEFT, point.OUTER_FOOT_RIGHT),
    }
    for _ in range(40_000):
        robot.run_for(0.000125)
        threshold = min(estimator.left.baseline, estimator.right.baseline) + 2000.0
        volts = max(robot.plant.analog_end[foot] for foot in feet[swing])
        if estimator.stage == 2 and crossed_at is None and volts * counts_per_volt >= threshold:
            crossed_at = robot.loop.time
        if estimator.swing_leg != swing:
            swing = estimator.swing_leg
            if crossed_at is not None:
                delays.append((robot.loop.time - crossed_at) * 1e-6)
            crossed_at = None
    assert len(delays) >= 5
    # one row of 4-4.5 ms at worst, link and slot 2 ms, two ticks in a row 2-4 ms; about 5 ms in the mean
    assert 3.0 <= np.mean(delays) <= 7.0
    assert max(delays) <= 12.0


def test_the_estimator_knows_the_leg_angle(walking):
    errors = []
    for _ in range(100):
        walking.run_for(0.02)
        errors.append(walking.variable("E_LO_ANGLE") - walking.plant.body.outer.angle)
    # appendix 4.3: swing height to about 2 mm in 0.96 m, and steps that differ by several mrad; 30 mrad would be a
    # sign or a scale gone wrong
    assert np.max(np.abs(errors)) < 0.03


def test_a_users_function_takes_a_schedule_entry_and_its_cost_counts():
    robot = Ranger(Scenario())
    law = robot.board("MCH").scheduler.find("mc_compliant_control")
    original, calls = law.function, []

    def mine():
        calls.append(robot.board("MCH").now)
        return original()

    robot.replace("MCH", "mc_compliant_control", mine, cost=9000, limit=12000)
    robot.run_for(0.1)
    assert len(calls) == pytest.approx(200, abs=3)  # every 0.5 ms slot
    task = robot.board("MCH").scheduler.find("mc_compliant_control")
    assert task.last_cycles == 9000


def test_a_fallen_robot_ends_the_walk_with_a_cause():
    robot = Ranger(Scenario(slope_rad=-0.2))  # too steep uphill for any gait of ours
    assert robot.run(StopRule(time_s=30.0), 30.0)
    summary = robot.summary()
    assert summary["fell"] and summary["fall_cause"]
