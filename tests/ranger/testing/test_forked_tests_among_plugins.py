"""A test in a forked process lives in pytest's protocol: plugins do with it what they do with every test."""

import importlib.util
import os
import signal
import subprocess
import sys

import pytest

from tests.ranger.testing.project import environment, how_to_find_the_plugin, pytest_in, write

# What popular plugins do, in a few lines: run a test again by pytest's own `runtestprotocol`, as pytest-rerunfailures;
# limit its time by an alarm that fails it, as pytest-timeout; note outcomes for fixtures, as pytest's documentation.
PLUGINS = """\
import os
import signal

import pytest
from _pytest.runner import runtestprotocol


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item, nextitem):
    mark = item.get_closest_marker("limit")

    def late(*_):
        pytest.fail("too late")

    if mark is not None:
        signal.signal(signal.SIGALRM, late)
        signal.setitimer(signal.ITIMER_REAL, mark.args[0])
    try:
        return (yield)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


class Again:
    @pytest.hookimpl(trylast=False)
    def pytest_runtest_protocol(self, item, nextitem):
        if item.get_closest_marker("again") is None:
            return None
        item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        for attempt in range(2):
            reports = runtestprotocol(item, nextitem=nextitem, log=False)
            if not any(each.failed for each in reports):
                break
        item.user_properties.append(("attempts", attempt + 1))
        for report in reports:
            report.user_properties = item.user_properties
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        return True


def pytest_configure(config):
    config.pluginmanager.register(Again())
    for mark in ("limit(seconds)", "again"):
        config.addinivalue_line("markers", mark)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(item, call):
    report = yield
    vars(item).setdefault("outcomes", {})[call.when] = report.outcome
    report.sections.append(("of every report", "added by a plugin"))
    return report


def pytest_runtest_call(item):
    os.environ["CALLED"] = item.name  # what acts on the process acts on the test


def pytest_sessionfinish(session):
    with open("outcomes", "w") as file:
        for item in session.items:
            print(item.name, *vars(item).get("outcomes", {}).values(), file=file)
"""

TESTS = """\
import os
import pathlib
import signal
import sys
import time
import unittest

import pytest

pytestmark = pytest.mark.ranger(seed=5, warmed_up="0.01 s")
PARENT = os.getpid()
made = []


def note(name):
    with open(name, "a") as file:
        print(os.getpid(), file=file)


@pytest.fixture(scope="module", params=["a", "b"])
def each_of_two(request):
    note("set up")
    yield request.param
    note("torn down")


@pytest.fixture(scope="module")
def asked_for_in_a_test():
    note("asked for")
    yield
    note("given back")


@pytest.fixture
def walking(ranger):
    ranger.run_for(0.01)
    yield ranger
    assert ranger.time_s == pytest.approx(0.03, abs=0.001)


@pytest.fixture
def outcome_is_known(request):
    yield
    assert request.node.outcomes == {"setup": "passed", "call": "failed"}


def test_first(ranger, each_of_two):
    assert os.getpid() != PARENT and os.environ["CALLED"].startswith("test_first")


def test_second(ranger, each_of_two):
    pass


def test_asks(ranger, request):
    request.getfixturevalue("asked_for_in_a_test")


def test_walking(walking):
    walking.run_for(0.01)


def test_walks_too_little(walking):
    pass


def test_fails(ranger, outcome_is_known):
    assert ranger.steps == 7


@pytest.mark.limit(1.0)
def test_sleeps(ranger):
    print("before")
    time.sleep(600)


@pytest.mark.limit(0.5)
def test_cannot_be_interrupted(ranger):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    time.sleep(600)


@pytest.mark.again
@pytest.mark.limit(1.0)
def test_sleeps_once(ranger, tmp_path_factory):
    mark = tmp_path_factory.getbasetemp() / "slept"
    if not mark.exists():
        mark.write_text("")
        time.sleep(600)


@pytest.mark.again
def test_dies_once(ranger, tmp_path_factory):
    mark = tmp_path_factory.getbasetemp() / "died"
    if not mark.exists():
        mark.write_text("")
        os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.again
def test_fails_twice(ranger):
    assert ranger.steps == 7


def test_parts(ranger, subtests):
    for number in range(3):
        with subtests.test(number=number):
            assert number != 1


def test_good_parts(ranger, subtests):
    with subtests.test():
        pass


@pytest.fixture
def dying():
    os.abort()


def test_of_a_fixture_that_dies(ranger, dying):
    pass


class OwnError(Exception):
    def __init__(self, one, two):
        super().__init__(f"{one} and {two}")


def test_raises_what_cannot_be_sent(ranger):
    raise OwnError(1, 2)


@pytest.mark.xfail(raises=OwnError, strict=True)
def test_expected_of_a_class(ranger):
    raise OwnError(1, 2)


@pytest.mark.xfail(raises=KeyError, strict=True)
def test_expected_of_another_class(ranger):
    raise OwnError(1, 2)


@pytest.mark.limit(20.0)
def test_leaves_a_process(ranger):
    os.mkfifo("hold")
    if os.fork() == 0:  # it holds what the test's process had open
        with open("hold"):
            os._exit(0)
    os._exit(5)


def test_lets_it_go():
    with open("hold", "w"):
        pass


@pytest.mark.usefixtures("ranger")
class TestUnit(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        note("class")

    def setUp(self):
        self.number = 1

    def test_unit(self):
        assert self.number == 1 and os.getpid() != PARENT

    def test_unit_fails(self):
        assert os.getpid() == PARENT
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("among")
    write(folder, conftest=PLUGINS, test_many=TESTS)
    return folder


@pytest.fixture(scope="module")
def done(folder):
    return pytest_in(folder)


def test_every_test_is_reported_and_the_session_ends_by_itself(done):
    assert done.code == 1 and "INTERNALERROR" not in done.text, done.text
    assert done.outcome("test_good_parts") == "passed" and done.outcome("test_unit") == "passed"


def test_fixtures_of_a_wider_scope_are_set_up_once_and_in_the_parent(done, folder):
    """Both values of a parameter, one after the other, for two tests each."""
    for name in ("test_first[a]", "test_second[a]", "test_first[b]", "test_second[b]"):
        assert done.outcome(name) == "passed", done.text
    up, down = ((folder / name).read_text().split() for name in ("set up", "torn down"))
    assert len(up) == 2 and up == down and len(set(up)) == 1
    assert len((folder / "class").read_text().split()) == 1


def test_a_fixture_of_a_wider_scope_that_a_test_asks_for_while_it_runs_ends_with_its_process(done, folder):
    asked, given = ((folder / name).read_text().split() for name in ("asked for", "given back"))
    assert asked == given and asked != (folder / "set up").read_text().split()[:1]


def test_a_fixture_that_takes_the_robot_acts_on_the_branch_before_and_after_the_test(done):
    assert done.outcome("test_walking") == "passed", done.text
    assert "assert 0.02" in done.reason("test_walks_too_little")


def test_a_fixture_knows_the_outcome_that_a_plugin_noted(done):
    assert done.outcome("test_fails") == "failure" and "request.node.outcomes" not in done.reason("test_fails")


def test_the_parents_plugins_know_every_outcome(done, folder):
    noted = dict(line.split(" ", 1) for line in (folder / "outcomes").read_text().splitlines())
    assert noted["test_walking"] == "passed passed passed"
    assert noted["test_fails"] == "passed failed passed"
    assert noted["test_of_a_fixture_that_dies"] == "failed passed"
    assert noted["test_sleeps"] == "passed failed passed"


def test_what_a_plugin_adds_to_a_report_is_there_once(done):
    assert done.text.count("added by a plugin") == done.text.count("of every report")
    fails = done.text.split("___ test_fails ___")[1].split("\n____")[0]
    assert fails.count("added by a plugin") == 1


def test_a_time_limit_is_reported_at_the_line_that_takes_so_long(done):
    assert done.outcome("test_sleeps") == "failure"
    reason = done.reason("test_sleeps")
    assert ">       time.sleep(600)" in reason and "E       Failed: too late" in reason
    assert "forking.py" not in reason and "before" in reason
    assert "once more: pytest test_many.py::test_sleeps" in done.text


def test_a_time_limit_ends_a_test_that_cannot_be_interrupted(done):
    assert "too late" in done.reason("test_cannot_be_interrupted")


def test_a_test_that_is_run_again_has_a_new_process(done):
    for name in ("test_sleeps_once", "test_dies_once"):
        assert done.outcome(name) == "passed" and done.properties(name)["attempts"] == "2", done.text
    assert done.outcome("test_fails_twice") == "failure" and done.properties("test_fails_twice")["attempts"] == "2"


def test_a_test_of_which_a_part_fails_is_not_green(done):
    assert done.outcome("test_parts") == "failure", done.text
    assert "contains 1 failed subtest" in done.text and "1 failed subtest" not in done.reason("test_good_parts")
    assert "SUBFAILED(number=1) test_many.py::test_parts" in done.text


def test_a_fixture_that_ends_the_process_is_an_error_of_the_set_up(done):
    assert done.outcome("test_of_a_fixture_that_dies") == "error"
    assert "killed by signal 6 (SIGABRT)" in done.reason("test_of_a_fixture_that_dies")


def test_an_exception_that_cannot_be_sent_is_reported_all_the_same(done):
    assert "test_many.OwnError: 1 and 2" in done.reason("test_raises_what_cannot_be_sent")
    assert done.outcome("test_expected_of_a_class") == "skipped"  # as JUnit has it
    assert done.outcome("test_expected_of_another_class") == "failure"


def test_the_end_of_a_process_is_seen_also_while_its_own_child_goes_on(done):
    assert "ended with code 5 before the test did" in done.reason("test_leaves_a_process")


def test_a_test_case_of_unittest_is_forked_as_well(done):
    assert "assert os.getpid() == PARENT" in done.reason("test_unit_fails")


@pytest.mark.parametrize("how", ["fd", "sys", "tee-sys"])
def test_output_is_captured_in_every_way(tmp_path, how):
    write(
        tmp_path,
        test_one="""
import logging, sys
import pytest
pytestmark = pytest.mark.ranger(warmed_up="0.01 s")

@pytest.fixture
def talking():
    print("in the set-up")
    yield
    print("in the tear-down")

def test_talks(ranger, talking, caplog):
    print("in the body")
    print("in its errors", file=sys.stderr)
    logging.getLogger("x").warning("in its log")
    assert [each.message for each in caplog.records] == ["in its log"]
    assert ranger.steps == 7
""",
    )
    done = pytest_in(tmp_path, "--capture", how)
    shown = done.text.split("___ test_talks ___")[1]
    for name, text in (
        ("Captured stdout setup", "in the set-up"),
        ("Captured stdout call", "in the body"),
        ("Captured stderr call", "in its errors"),
        ("Captured log call", "in its log"),
    ):
        assert shown.count(name) == 1 and text in shown.split(name)[1].split("\n---")[0], done.text
    assert shown.count("in the tear-down") == 1


def test_the_first_failure_ends_the_session_where_that_is_asked_for(tmp_path):
    write(
        tmp_path,
        test_one="""
import pytest
pytestmark = pytest.mark.ranger(warmed_up="0.01 s")

def test_fails(ranger, subtests):
    with subtests.test():
        assert ranger.steps == 7
    open("behind", "w")

def test_next(ranger):
    pass
""",
    )
    done = pytest_in(tmp_path, "-x")
    assert "stopping after" in done.text and "test_next" not in done.cases, done.text
    assert not (tmp_path / "behind").exists()


def test_a_test_may_end_the_session(tmp_path):
    write(
        tmp_path,
        test_one="""
import pytest
pytestmark = pytest.mark.ranger(warmed_up="0.01 s")

@pytest.fixture
def closing():
    yield
    open("closed", "w")

def test_ends(ranger, closing):
    pytest.exit("enough", returncode=9)

def test_next(ranger):
    pass
""",
    )
    done = pytest_in(tmp_path)
    assert done.code == 9 and "enough" in done.text and "test_next" not in done.cases
    assert (tmp_path / "closed").exists()


def test_an_interrupt_ends_the_session_and_the_tests_process(tmp_path):
    """Of the parent alone, as `kill -INT` sends it: function fixtures are torn down in the child, which then ends."""
    write(
        tmp_path,
        test_one="""
import os, time
import pytest
pytestmark = pytest.mark.ranger(warmed_up="0.01 s")

@pytest.fixture
def closing():
    yield
    open("closed", "w")

def test_sleeps(ranger, closing):
    print("process", os.getpid(), flush=True)
    time.sleep(600)
""",
    )
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-s", *how_to_find_the_plugin()]
    with subprocess.Popen(
        command, cwd=tmp_path, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as session:
        for line in session.stdout:
            if "process " in line:
                child = int(line.split("process ")[1])
                break
        session.send_signal(signal.SIGINT)
        rest = session.stdout.read()
        assert session.wait(60) == 2 and "KeyboardInterrupt" in rest
    assert (tmp_path / "closed").exists()
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)


# ---- real plugins, where they are installed


@pytest.mark.skipif(importlib.util.find_spec("pytest_rerunfailures") is None, reason="pytest-rerunfailures is missing")
@pytest.mark.skipif(importlib.util.find_spec("pytest_timeout") is None, reason="pytest-timeout is missing")
def test_pytest_timeout_and_pytest_rerunfailures_agree_with_a_branched_test(tmp_path):
    write(
        tmp_path,
        test_one="""
import pathlib, time
import pytest
pytestmark = pytest.mark.ranger(seed=3, warmed_up="0.01 s")

@pytest.mark.timeout(1)
def test_hangs_once(ranger, tmp_path_factory):
    mark = tmp_path_factory.getbasetemp() / "hung"
    if not mark.exists():
        mark.write_text("")
        time.sleep(600)

@pytest.mark.timeout(1, func_only=True)
def test_hangs(ranger):
    time.sleep(5)

def test_after(ranger):
    ranger.run_for(0.01)
""",
    )
    done = pytest_in(tmp_path, "--reruns", "1")
    assert [done.outcome(f"test_{name}") for name in ("hangs_once", "hangs", "after")] == [
        "passed",
        "failure",
        "passed",
    ]
    assert "Timeout" in done.reason("test_hangs") and ">       time.sleep(5)" in done.reason("test_hangs")
