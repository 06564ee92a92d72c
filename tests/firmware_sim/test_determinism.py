"""Same inputs, same everything: twice in a row, interpreted and compiled."""

import os
import pathlib
import subprocess
import sys

from tests.firmware_sim.workload import activity_digest, run

ROOT = pathlib.Path(__file__).parents[2]


def digests(interpreted, hash_seed):
    environment = {**os.environ, "PYTHONHASHSEED": hash_seed}
    environment["RANGER_SIM_INTERPRETED"] = "1" if interpreted else ""
    reported = subprocess.run(
        [sys.executable, "-m", "tests.firmware_sim.workload"],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    return reported.stdout.split()


def test_the_workload_meets_every_case_that_it_should():
    board = run(1)[1]
    scheduler = board.scheduler
    assert scheduler.overruns > 5
    assert scheduler.dropped_tasks > 5
    assert scheduler.near_limits > 0
    assert board.timer0.lost[0] > 0
    assert scheduler.find("wait").waits > 0
    assert scheduler.find("long").hits > 0
    assert all(source.served > 0 for source in board.vic.sources.values() if source.attached)


def test_interpreted_and_compiled_runs_give_the_same_bits_whatever_the_hash_seed():
    kind, *plain = digests(interpreted=True, hash_seed="1")
    assert kind == "interpreted"
    _, *other = digests(interpreted=False, hash_seed="2")
    assert plain == other
    assert plain == [run(1)[0], run(2)[0], activity_digest(1)]
    assert plain[0] != plain[1]
