"""A branch that dies, raises or hangs is a result, and harms nobody."""

import os
import signal

import pytest

from ranger_sim.harness.campaigns.branching import BranchError, branch


def test_a_branch_gives_back_what_it_found_and_nothing_else():
    seen = []
    assert branch(lambda: {"n": len(seen) + 1, "also": seen.append(1)}, 10.0) == {"n": 1, "also": None}
    assert seen == []


def test_a_long_result_comes_whole():
    assert branch(lambda: {"text": "x" * 3_000_000}, 30.0)["text"] == "x" * 3_000_000


def test_a_branch_that_raises_has_crashed_with_its_reason():
    def work():
        raise ValueError("no such pin")

    with pytest.raises(BranchError, match=r"ValueError: no such pin \(test_branching.py:") as error:
        branch(work, 10.0)
    assert error.value.outcome == "crashed"


def test_a_branch_that_is_killed_has_crashed():
    with pytest.raises(BranchError, match="its process ended with -9") as error:
        branch(lambda: os.kill(os.getpid(), signal.SIGKILL) or {}, 10.0)
    assert error.value.outcome == "crashed"


def test_a_branch_that_hangs_is_ended_at_its_limit():
    with pytest.raises(BranchError, match=r"longer than 0\.2 s") as error:
        branch(lambda: signal.pause() or {}, 0.2)
    assert error.value.outcome == "timed out"


def test_a_branch_may_leave_by_exit_and_runs_none_of_the_parents_clean_up():
    with pytest.raises(BranchError, match="SystemExit"):
        branch(lambda: exit(3), 10.0)
