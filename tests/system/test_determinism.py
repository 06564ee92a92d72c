"""Same scenario and seed, same bytes: interpreted or compiled, twice, whatever the hash seed."""

import os
import pathlib
import subprocess
import sys

import pytest

from ranger_sim.harness.ranger import Ranger
from ranger_sim.harness.scenario import Scenario
from tests.system.digest_of import digest

ROOT = pathlib.Path(__file__).resolve().parents[2]
RELEASE_S = 1.5  # the operator lets the robot go; two seconds of walking follow
WALK_S = RELEASE_S + 2.0
HOURS_31_MS = 31 * 3600 * 1000
BEFORE_WRAP_MS = 2**32 - 2500  # the count of milliseconds wraps one second into the walk


def digest_elsewhere(seconds, uptime_ms, interpreted, hash_seed):
    environment = {
        **os.environ,
        "RANGER_SIM_INTERPRETED": "1" if interpreted else "",
        "PYTHONHASHSEED": str(hash_seed),
    }
    done = subprocess.run(
        [sys.executable, "-m", "tests.system.digest_of", str(seconds), str(uptime_ms)],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
    )
    return done.stdout.strip()


@pytest.mark.parametrize(
    ("uptime_ms", "what"),
    [(0, "power-up"), (HOURS_31_MS, "31 h of uptime"), (BEFORE_WRAP_MS, "the wrap of the ms count")],
    ids=lambda value: str(value).replace(" ", "_"),
)
def test_two_seconds_of_walking_are_the_same_bytes_compiled_and_interpreted(uptime_ms, what):
    here = digest(WALK_S, uptime_ms)
    assert here == digest_elsewhere(WALK_S, uptime_ms, interpreted=True, hash_seed=1), what
    assert here == digest_elsewhere(WALK_S, uptime_ms, interpreted=False, hash_seed=2), what


def test_the_robot_steps_on_across_the_wrap_of_its_clock():
    robot = Ranger(Scenario(start_uptime_ms=BEFORE_WRAP_MS))
    robot.run_for(8.0)
    assert robot.boards["CSR"].time.ms < 10_000, "the count has wrapped"
    assert robot.steps >= 6 and not robot.ended


def test_another_seed_is_another_walk():
    assert digest(0.2) != digest_of_seed(2, 0.2)


def digest_of_seed(seed, seconds):
    robot = Ranger(Scenario(seed=seed))
    robot.run_for(seconds)
    return robot.trace_digest()


def test_a_walk_does_not_depend_on_how_it_is_sliced():
    whole, sliced = Ranger(Scenario()), Ranger(Scenario())
    whole.run_for(2.1)
    for _ in range(30):
        sliced.run_for(0.07)
    assert whole.trace_digest() == sliced.trace_digest()
