"""Who does the runs: what is closed starts nothing any more, and a run at which processes die is reported as such."""

import subprocess
import sys
import threading

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.campaigns import pools
from ranger_sim.harness.campaigns.pools import LocalPool, results_of


def request(*keys):
    return {"cases": [{"key": key} for key in keys]}


@pytest.fixture
def started(monkeypatch):
    """Lets processes run the given program instead of a group's; those that were started."""
    processes = []
    start = pools.process_for

    def noting(asked):
        processes.append((pools.asked(asked), start(asked)))
        return processes[-1][1]

    def program(text):
        monkeypatch.setattr(pools, "COMMAND", (sys.executable, "-c", text))
        monkeypatch.setattr(pools, "process_for", noting)
        return processes

    return program


ANSWER_ALL = """
import json, sys
for case in json.loads(sys.stdin.readline())["cases"]:
    print(json.dumps({"key": case["key"], "outcome": "masked"}))
"""
DIE_AT_B = """
import json, sys
for case in json.loads(sys.stdin.readline())["cases"]:
    if case["key"] == "b":
        sys.exit(7)
    print(json.dumps({"key": case["key"], "outcome": "masked"}), flush=True)
"""
WAIT = "import sys; sys.stdin.readline(); print('x', file=sys.stderr, flush=True); import signal; signal.pause()"


def test_every_request_is_answered_once_however_many_work_on_them(started):
    started(ANSWER_ALL)
    pool = LocalPool(3)
    found = [result["key"] for result in pool.run([request("a", "b"), request("c"), request("d", "e", "f")])]
    assert sorted(found) == list("abcdef")
    assert list(pool.run([])) == []


def test_a_run_at_which_three_processes_died_has_crashed_and_the_others_have_their_results(started):
    processes = started(DIE_AT_B)
    found = {result["key"]: result for result in results_of(request("a", "b", "c"), pools.process_for)}
    assert [found[key]["outcome"] for key in "abc"] == ["masked", "crashed", "masked"]
    assert found["b"]["why"] == "its process ended with 7, 3 times"
    # what came before a death is not asked for again
    assert [asked for asked, _ in processes] == [["a", "b", "c"], ["b", "c"], ["b", "c"], ["c"]]


def test_a_refusal_of_a_worker_is_the_users_mistake(started):
    started("import json; print(json.dumps({'refused': 'no such body'}))")
    with pytest.raises(UserError, match="no such body"):
        list(LocalPool(2).run([request("a"), request("b")]))


def test_a_pool_that_is_closed_has_ended_its_processes_and_starts_no_other_in_their_place(started):
    processes = started(WAIT)
    pool = LocalPool(2)
    results = []
    caller = threading.Thread(target=lambda: results.extend(pool.run([request(key) for key in "abcd"])))
    caller.start()
    while len(processes) < 2:
        pass
    pool.close()
    caller.join(timeout=60.0)
    assert not caller.is_alive() and results == []
    assert len(processes) == 2 and all(process.returncode is not None for _, process in processes)
    assert list(pool.run([request("e")])) == []


def test_a_group_that_is_handed_nothing_ends():
    done = subprocess.run([*pools.COMMAND], stdin=subprocess.DEVNULL, capture_output=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (1, b"", b"")
