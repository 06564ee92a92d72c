"""EXECUTION_TIME of the satellites on the whole robot, compared with what the robot's logs have."""

import contextlib

import pytest

from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.ranger.timing import robot_figures

# EXECUTION_TIME in us (robot.md T1). UI: the logs' main brain sends six lights in every slot, so ours does here.
LOGS = robot_figures.EXECUTION_TIME_US
REZEROING = robot_figures.REZEROING_US


@pytest.fixture(scope="module")
def measured():
    """(held, walking, noted): per board the EXECUTION_TIMEs of every 0.1 s, us, and its errors in all."""
    quirks = Quirks(lights_in_every_slot=True)
    with contextlib.closing(Ranger(Scenario(), quirks=quirks)) as robot:
        release = robot.controller.operator.release_time_s

        def watch(more):
            times = {name: [] for name in LOGS}
            while more():
                robot.run_for(0.1)
                for name, seen in times.items():
                    seen.append(1e6 * robot.board(name).execution.seconds())
            return times

        robot.run_for(0.3)  # the first slots after power-up are not the usual ones
        held = watch(lambda: robot.time_s < release - 0.15)
        robot.run_for(0.5)
        walking = watch(lambda: robot.steps < 20 and not robot.ended)
        assert robot.steps == 20
        noted = {name: robot.board(name).errors.totals for name in LOGS}
        assert all(robot.board(name).scheduler.overruns == 0 for name in LOGS)
        yield held, walking, noted


@pytest.mark.parametrize("name", LOGS)
def test_held_the_median_is_one_of_the_logs(measured, name):
    times = sorted(measured[0][name])
    assert LOGS[name][0][0] <= times[len(times) // 2] <= LOGS[name][0][1]


@pytest.mark.parametrize("name", LOGS)
def test_walking_all_are_within_those_of_the_logs(measured, name):
    times = measured[1][name]
    low, high = LOGS[name][1]
    assert low <= min(times) and max(times) <= high


@pytest.mark.parametrize("name", ["MCFO", "MCFI"])
def test_walking_an_ankle_takes_no_longer_than_while_its_encoder_is_set(measured, name):
    # the robot's worst was 446 and 497 us; what made it is in no log, and our worst is the re-zeroing
    assert max(measured[1][name]) <= REZEROING[1]


def test_a_plain_walk_has_the_errors_that_the_robots_had(measured):
    # robot.md T3: glitches of the hip joint's encoder in most of the logs' cycles, and bad levels of the radio
    noted = measured[2]
    assert 20 < noted["MCH"][codes.QDC_CH01_GLTCH] < 500
    assert 1 <= noted["UI"][codes.RCX_BAD_LVLS] < 10
    assert noted["MCFI"][codes.MC_TCURR_OOB] > 100
