"""A branch that dies, raises or hangs is a result, and harms no other."""

import os
import signal

import pytest

from ranger_sim.foundation import descriptors
from ranger_sim.harness import branching
from ranger_sim.harness.branching import BranchError, branch


def branched(work):
    return branch(work, 30.0, 300.0)


def test_a_branch_gives_back_what_it_found_and_nothing_else():
    seen = []
    assert branched(lambda: {"n": len(seen) + 1, "also": seen.append(1)}) == {"n": 1, "also": None}
    assert seen == []


def test_a_long_result_comes_whole():
    assert branched(lambda: {"text": "x" * 3_000_000})["text"] == "x" * 3_000_000


def test_a_branch_that_raises_has_crashed_with_its_reason():
    def work():
        raise ValueError("no such pin")

    with pytest.raises(BranchError, match=r"ValueError: no such pin \(test_branching.py:") as error:
        branched(work)
    assert error.value.outcome == "crashed"


def test_a_branch_that_is_killed_has_crashed():
    with pytest.raises(BranchError, match="its process ended with -9") as error:
        branched(lambda: os.kill(os.getpid(), signal.SIGKILL) or {})
    assert error.value.outcome == "crashed"


def test_a_result_that_cannot_be_sent_is_a_crash_with_its_reason():
    with pytest.raises(BranchError, match="TypeError: Object of type object is not JSON serializable") as error:
        branched(lambda: {"what": object()})
    assert error.value.outcome == "crashed"


def test_a_branch_that_dies_while_it_sends_its_result_has_crashed():
    def work():
        whole = os.fdopen

        def half(*arguments, **more):
            pipe = whole(*arguments, **more)
            pipe.write('{"half')
            pipe.flush()
            os.kill(os.getpid(), signal.SIGKILL)

        branching.os.fdopen = half  # in the forked process alone
        return {}

    with pytest.raises(BranchError, match="its process ended with -9 while it sent its result") as error:
        branched(work)
    assert error.value.outcome == "crashed"


def test_a_branch_ends_with_the_process_that_it_branched_off(tmp_path):
    reported = tmp_path / "process"
    parent = os.fork()
    if parent == 0:
        branched(lambda: reported.write_text(str(os.getpid())) and signal.pause())
        os._exit(0)
    while not (reported.exists() and reported.read_text()):
        os.sched_yield()
    watch = os.pidfd_open(int(reported.read_text()))
    os.kill(parent, signal.SIGKILL)
    os.waitpid(parent, 0)
    assert descriptors.wait([watch], [], 60.0)[0] == [watch]
    os.close(watch)


def test_a_branch_that_waits_for_ever_is_ended_at_its_limit():
    with pytest.raises(BranchError, match=r"no result within 0\.2 s of the wall clock") as error:
        branch(lambda: signal.pause() or {}, 10.0, 0.2)
    assert error.value.outcome == "timed out"


def test_a_branch_that_computes_for_ever_is_ended_by_what_it_computed():
    def work():
        while True:
            pass

    with pytest.raises(BranchError, match="longer than 1 s of computing") as error:
        branch(work, 1.0, 300.0)
    assert error.value.outcome == "timed out"


def test_a_branch_may_leave_by_exit_and_runs_none_of_the_parents_clean_up():
    with pytest.raises(BranchError, match="SystemExit"):
        branched(lambda: exit(3))
