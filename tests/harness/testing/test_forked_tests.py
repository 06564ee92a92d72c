"""Tests of a warmed-up robot run in branches of it: forked processes, as good as a fresh robot, and as good tests."""

import importlib.util

import pytest

from ranger_sim.harness.ranger import Ranger
from ranger_sim.harness.scenario import Scenario
from tests.harness.testing.project import pytest_in, write

TESTS = """\
import os
import warnings

import pytest

pytestmark = pytest.mark.ranger(seed=5, warmed_up="0.05 s")
PARENT = os.getpid()
made = []


@pytest.fixture(scope="module")
def shared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shared")
    (folder / "made").write_text("1")
    yield folder
    (folder / "torn").write_text(str(os.getpid()))


@pytest.mark.parametrize("each", range(3))
def test_digest(ranger, each, record_property):
    assert os.getpid() != PARENT
    assert ranger.time_s == pytest.approx(0.05, abs=0.0005)
    ranger.run_for(0.1 - ranger.time_s)
    record_property("digest", ranger.trace_digest())
    made.append(each)
    assert made == [each]  # nothing of another test is here


def test_not_forked(shared):
    assert os.getpid() == PARENT


def test_uses_what_the_parent_has_set_up(ranger, shared, tmp_path):
    assert (shared / "made").exists()
    assert tmp_path.parent == shared.parent


def test_what_the_parent_has_set_up_is_still_there(shared):
    assert not (shared / "torn").exists()


def test_fails_with_output(ranger):
    print("what the test said")
    assert ranger.steps == 7


def test_dies(ranger):
    print("its last words", flush=True)
    os.abort()


def test_leaves(ranger):
    os._exit(3)


def test_warns(ranger):
    warnings.warn("a warning from a branch", UserWarning, stacklevel=1)


@pytest.mark.skip(reason="not today")
def test_skipped(ranger):
    pass


@pytest.mark.xfail(strict=True)
def test_expected_to_fail(ranger):
    assert ranger.steps == 7


def test_tears_down_badly(ranger, request):
    request.addfinalizer(lambda: 1 / 0)


@pytest.mark.ranger(warmed_up="step 0", colour="red")
def test_wrong_order(ranger):
    pass


@pytest.mark.ranger(warmed_up="hip in NOWHERE")
def test_wrong_warm_up(ranger):
    pass


@pytest.mark.ranger(warmed_up="step 0", seed="three")
def test_wrong_seed(ranger):
    pass


@pytest.mark.expects_errors("AE_SPYKE")
def test_wrong_error(ranger):
    pass


@pytest.mark.expects(overrun=True)
def test_wrong_expectation(ranger):
    pass


@pytest.mark.expects("fall")
def test_expectation_without_name(ranger):
    pass


@pytest.mark.can_bus(bitrate=3)
def test_wrong_bus(can_bus):
    pass


def test_mistake_in_a_call(ranger):
    ranger.inject("MCH.joint_encodr", "stuck")


def test_fault_that_does_not_act(ranger):
    ranger.inject("MCH.joint_encoder", "stuck", at="step 9")
"""


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    folder = tmp_path_factory.mktemp("forked")
    write(folder, test_many=TESTS)
    return pytest_in(folder)


def digest_of_a_fresh_robot(seed, time_s):
    robot = Ranger(Scenario(seed=seed))
    robot.run_for(time_s)
    return robot.trace_digest()


def test_a_branch_has_the_digest_of_a_fresh_robot(done):
    expected = digest_of_a_fresh_robot(5, 0.1)
    for each in range(3):
        assert done.outcome(f"test_digest[{each}]") == "passed", done.text
        assert done.properties(f"test_digest[{each}]")["digest"] == expected


def test_fixtures_of_the_parent_are_seen_and_not_torn_down_by_a_branch(done):
    for name in ("not_forked", "uses_what_the_parent_has_set_up", "what_the_parent_has_set_up_is_still_there"):
        assert done.outcome(f"test_{name}") == "passed", done.text


def test_a_failure_comes_with_its_output_and_with_how_it_comes_again(done):
    assert done.outcome("test_fails_with_output") == "failure"
    assert "what the test said" in done.text
    assert "once more: pytest test_many.py::test_fails_with_output --ranger-seed 5 --ranger-backend sim" in done.text


def test_a_branch_that_dies_is_a_failed_test_that_says_of_what(done):
    assert "the process of the test was killed by signal 6 (SIGABRT)" in done.reason("test_dies")
    assert "its last words" in done.text
    assert "the process of the test ended with code 3 before the test did" in done.reason("test_leaves")


def test_what_else_a_test_can_be(done):
    assert done.outcome("test_warns") == "passed" and "a warning from a branch" in done.text
    assert done.outcome("test_skipped") == "skipped" and "not today" in done.reason("test_skipped")
    assert done.outcome("test_expected_to_fail") == "skipped"  # as JUnit has it
    assert "ZeroDivisionError" in done.reason("test_tears_down_badly")


def test_a_wrong_order_is_told_in_a_line(done):
    assert "ranger(colour=...): what can be asked for is controller, body, seed" in done.reason("test_wrong_order")
    assert "hip has no state 'NOWHERE'" in done.reason("test_wrong_warm_up")
    assert "Traceback" not in done.reason("test_wrong_order") + done.reason("test_wrong_warm_up")


def test_a_wrong_mark_or_call_is_told_where_it_is_made_and_the_other_tests_go_on(done):
    assert "seed is 'three', a whole number from 0 on is expected" in done.reason("test_wrong_seed")
    assert "did you mean 'AE_SPIKE'" in done.reason("test_wrong_error")
    assert "expects(overrun=...): what can be expected is overruns" in done.reason("test_wrong_expectation")
    assert "'fall' has no name" in done.reason("test_expectation_without_name")
    assert "mark can_bus: " in done.reason("test_wrong_bus") and "'bitrate'" in done.reason("test_wrong_bus")
    assert "did you mean 'MCH.joint_encoder'" in done.reason("test_mistake_in_a_call")
    assert "catalogue.py" not in done.reason("test_mistake_in_a_call")  # not how we came to say so
    assert "INTERNALERROR" not in done.text


def test_a_test_whose_fault_did_not_act_is_never_green(done):
    assert done.outcome("test_fault_that_does_not_act") == "failure"
    assert "injected faults that did not act: MCH.joint_encoder:stuck" in done.reason("test_fault_that_does_not_act")


def test_with_a_debugger_or_on_request_nothing_is_forked(tmp_path):
    write(
        tmp_path,
        test_one="""
import os, pytest
PARENT = os.getpid()
pytestmark = pytest.mark.ranger(warmed_up="0.01 s")

def test_here(ranger):
    assert os.getpid() == PARENT and ranger.time_s >= 0.01
""",
    )
    for how in (("--pdb",), ("--ranger-fork", "no"), ("--ranger-scope", "module")):
        done = pytest_in(tmp_path, *how)
        assert done.code == 0, done.text


def test_a_mark_that_a_robot_of_a_wider_scope_cannot_heed_is_refused(tmp_path):
    write(
        tmp_path,
        test_one="""
import pytest

@pytest.mark.ranger(seed=4)
def test_of_its_own(ranger):
    pass
""",
    )
    done = pytest_in(tmp_path, "--ranger-scope", "module")
    assert "the fixtures have the scope module: their marks belong there" in done.reason("test_of_its_own")
    done = pytest_in(tmp_path, "--ranger-scope", "planet")
    assert done.code == 4 and "--ranger-scope is 'planet', allowed are function, class" in done.text


def test_a_robot_of_a_wider_scope_is_shared_and_looked_at_after_each_test(tmp_path):
    write(
        tmp_path,
        test_module="""
import pytest
pytestmark = pytest.mark.ranger(seed=2)

def test_first(ranger):
    ranger.run_for(0.02)

def test_second(ranger):
    assert ranger.time_s == pytest.approx(0.02)
    ranger.replace("MCSI", "dn_update_pwm", lambda: None, cost=40_000)
    ranger.run_for(0.01)

@pytest.mark.expects(overruns="MCSI")
def test_third(ranger):
    ranger.run_for(0.01)
""",
    )
    done = pytest_in(tmp_path, RANGER_SIM_SCOPE="module")
    assert [done.outcome(f"test_{name}") for name in ("first", "second", "third")] == ["passed", "failure", "passed"]
    assert "slot overruns: MCSI" in done.reason("test_second")


@pytest.mark.skipif(importlib.util.find_spec("perfetto") is None, reason="perfetto is not installed")
def test_a_failed_test_leaves_the_timeline_of_its_last_seconds(tmp_path):
    write(
        tmp_path,
        test_one="""
import pytest

@pytest.mark.ranger(seed=5, warmed_up="0.02 s")
@pytest.mark.parametrize("steps", [0, 7])
def test_steps(ranger, steps):
    ranger.run_for(0.02)
    assert ranger.steps == steps
""",
    )
    done = pytest_in(tmp_path, RANGER_SIM_TRACE="traces")
    assert done.outcome("test_steps[0]") == "passed"
    [path] = (tmp_path / "traces").iterdir()
    assert path.name == "test_one.py_test_steps_7_.pftrace" and path.stat().st_size > 10_000
    assert f"trace: ranger-sim trace open traces/{path.name}" in done.text


@pytest.mark.skipif(importlib.util.find_spec("xdist") is None, reason="pytest-xdist is not installed")
def test_workers_of_xdist_branch_their_own_robots(tmp_path):
    write(
        tmp_path,
        test_many="""
import pytest

@pytest.mark.ranger(seed=5, warmed_up="0.05 s")
@pytest.mark.parametrize("each", range(6))
def test_digest(ranger, each, record_property):
    ranger.run_for(0.1 - ranger.time_s)
    record_property("digest", ranger.trace_digest())
""",
    )
    done = pytest_in(tmp_path, "-n", "2")
    assert done.code == 0, done.text
    assert {done.properties(f"test_digest[{each}]")["digest"] for each in range(6)} == {digest_of_a_fresh_robot(5, 0.1)}
