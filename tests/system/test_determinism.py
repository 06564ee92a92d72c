"""Same scenario and seed, same bytes: interpreted or compiled, twice, whatever the hash seed."""

import dataclasses
import json
import os
import pathlib
import subprocess
import sys

import pytest

from ranger_sim import loading
from ranger_sim.boards.main_brain import controllers
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from tests.system.digest_of import Case, outcome

ROOT = pathlib.Path(__file__).resolve().parents[2]
RELEASE_S = 1.5  # the operator lets the robot go; two seconds of walking follow
WALK_S = RELEASE_S + 2.0
ONE_STEP_S = RELEASE_S + 0.5  # the first heel-strike is 0.3 to 0.4 s after the release
HOURS_31_MS = 31 * 3600 * 1000
BEFORE_WRAP_MS = 2**32 - 2500  # the count of milliseconds wraps one second into the walk

SEEDS = range(1, 25)
START_S = 0.03  # every board has passed its table once (the main brain: 22 ms), and over 500 frames were sent
PROCESSES_S = 0.2


def elsewhere(module, *arguments, interpreted, hash_seed):
    """What a module prints that runs as a separate process."""
    environment = {
        **os.environ,
        "RANGER_SIM_INTERPRETED": "1" if interpreted else "",
        "PYTHONHASHSEED": str(hash_seed),
    }
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
    )
    return done.stdout


def outcomes_elsewhere(cases, interpreted, hash_seed):
    """`outcome` of each case, in another process."""
    reported = json.dumps([dataclasses.asdict(case) for case in cases])
    return elsewhere("tests.system.digest_of", reported, interpreted=interpreted, hash_seed=hash_seed).splitlines()


@pytest.mark.parametrize(
    ("uptime_ms", "what"),
    [(0, "power-up"), (HOURS_31_MS, "31 h of uptime"), (BEFORE_WRAP_MS, "the wrap of the ms count")],
    ids=lambda value: str(value).replace(" ", "_"),
)
def test_two_seconds_of_walking_are_the_same_bytes_compiled_and_interpreted(uptime_ms, what):
    case = Case(WALK_S, uptime_ms=uptime_ms)
    here = outcome(case)
    assert here.endswith("on its feet")
    assert [here] == outcomes_elsewhere([case], interpreted=True, hash_seed=1), what
    assert [here] == outcomes_elsewhere([case], interpreted=False, hash_seed=2), what


def test_twenty_four_seeds_start_with_the_same_bytes_compiled_and_interpreted():
    """A seed chooses when each board starts and how fast its crystal is, so which of two comes first."""
    cases = [Case(START_S, seed) for seed in SEEDS]
    compiled = outcomes_elsewhere(cases, interpreted=False, hash_seed=1)
    assert len({each.split()[0] for each in compiled}) == len(SEEDS)
    assert compiled == outcomes_elsewhere(cases, interpreted=True, hash_seed=2)


FIRST_STEP_S = {"head-2015": ONE_STEP_S + 0.5}  # from its set-up it swings later
STEPS = {
    **{
        f"{name} on a rough floor": Case(
            FIRST_STEP_S.get(name, ONE_STEP_S), seed, controller=name, floor_roughness_m=0.001
        )
        for seed, name in enumerate(controllers.available(), 2)
    },
    "the firmware of 2016, downhill": Case(ONE_STEP_S, 5, firmware_2016=True, slope_rad=0.01),
    "the appendix's body": Case(ONE_STEP_S, 7, body="appendix"),
    "buses at 1 Mbit per s": Case(ONE_STEP_S, 6, profile="hil-1mbit"),
}


@pytest.mark.both_ways
@pytest.mark.parametrize("case", STEPS.values(), ids=[name.replace(" ", "_") for name in STEPS])
def test_a_step_is_the_same_bytes_compiled_and_interpreted_in_every_scenario(case):
    (compiled,) = outcomes_elsewhere([case], interpreted=False, hash_seed=1)
    assert " 0 steps" not in compiled
    assert [compiled] == outcomes_elsewhere([case], interpreted=True, hash_seed=2)


def test_boards_in_their_own_processes_start_with_the_same_bytes_compiled_and_interpreted():
    up = ("up", "--speed", "max", "--no-real-time", "--seed", "3", "--time", f"{PROCESSES_S}s", "--json", "-")
    expected = outcome(Case(PROCESSES_S, seed=3)).split()[0]
    for interpreted in (True, False):
        reported = json.loads(elsewhere("ranger_sim", *up, interpreted=interpreted, hash_seed=3))
        assert reported["compiled"] != interpreted or not loading.RUNS_COMPILED
        assert reported["trace_digest"] == expected


def test_the_robot_steps_on_across_the_wrap_of_its_clock():
    robot = Ranger(Scenario(start_uptime_ms=BEFORE_WRAP_MS))
    robot.run_for(8.0)
    assert robot.boards["CSR"].time.ms < 10_000, "the count has wrapped"
    assert robot.steps >= 6 and not robot.ended


def test_another_seed_is_another_walk():
    assert outcome(Case(0.2, seed=1)) != outcome(Case(0.2, seed=2))


def test_a_walk_does_not_depend_on_how_it_is_sliced():
    whole, sliced = Ranger(Scenario()), Ranger(Scenario())
    whole.run_for(2.1)
    for _ in range(30):
        sliced.run_for(0.07)
    assert whole.trace_digest() == sliced.trace_digest()
