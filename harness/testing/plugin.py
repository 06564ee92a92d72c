"""The pytest plugin for any machine: fixture `machine`, markers, options, branches, reports; see docs/testing.md.

Every pytest run imports this module, so it imports nothing heavy before a fixture needs it. The plugin of Ranger
(ranger/testing/plugin.py) registers this one, and adds its `Subject`.
"""

from __future__ import annotations

import dataclasses
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Generator, Iterator
from typing import TYPE_CHECKING, Any

import pytest

from ranger_sim.harness.testing import options
from ranger_sim.harness.testing.marks import (
    SUBJECTS,
    OwnMachine,
    Subject,
    add_subject,
    backend_of,
    expected_of,
    order_for,
    subjects,
    subjects_of,
)
from ranger_sim.harness.testing.options import COUNTS, option
from ranger_sim.harness.testing.report import Watched, description, properties

if TYPE_CHECKING:
    from ranger_sim.harness.machine import Machine
    from ranger_sim.harness.testing.forking import ForkedTest
    from ranger_sim.harness.testing.making import Order

MOST_KEPT = 8  # warmed-up robots kept for branching, some 30 MB each; chosen by us
MARKERS = (
    "machine(seed=1, warmed_up='angle_rad > 1', ...): the machine of the fixture `machine`, which the project's "
    "conftest.py makes in pytest_machine(wanted)",
    "requires(thing, ...): the test is skipped where the backend has not that thing",
    "expects_errors(name, ...): errors that the robot must show in this test; MCH:AE_SPIKE for one board",
    "expects(overruns=..., lost_frames=..., bus_errors=..., bus_off=..., dead=..., fall=..., idle_faults=...): "
    "what else must happen",
)


class WarmedUp:
    """Machines of this process that have been warmed up once, to be branched by forking. They never run on."""

    def __init__(self) -> None:
        self.kept: dict[Order, Machine] = {}

    def prepare(self, order: Order) -> bool:
        """Make the robot of `order`; False when that fails: the test reports why when it makes its own."""
        from ranger_sim.foundation.user_error import UserError
        from ranger_sim.harness.testing.making import made

        if order not in self.kept:
            try:
                robot = made(order)
            except (UserError, AssertionError):
                return False
            while len(self.kept) >= MOST_KEPT:
                self.kept.pop(next(iter(self.kept))).close()
            self.kept[order] = robot
        return True


WARMED_UP = pytest.StashKey[WarmedUp]()
COUNTING = pytest.StashKey[str]()
ALONE = pytest.StashKey[Any]()  # a board under test, with its `firmware`
REPORTED = pytest.StashKey[dict[Any, int]]()
ROBOTS = pytest.StashKey[list[Watched]]()
BRANCH = pytest.StashKey[str]()  # the fixture whose machine is a branch of a warmed-up one
FORKED: pytest.StashKey[ForkedTest] = pytest.StashKey()  # of a test that runs in its own process, in the parent
SHELTERED = pytest.StashKey[bool]()  # in its own process, in which programs in C run as well


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    options.add(parser)


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    """Add the hooks that a conftest.py may implement."""
    from ranger_sim.harness.testing import hooks

    pluginmanager.add_hookspecs(hooks)


def pytest_configure(config: pytest.Config) -> None:
    """Register markers, and check options."""
    for marker in MARKERS:
        config.addinivalue_line("markers", marker)
    add_subject(config, OwnMachine())
    config.stash[WARMED_UP] = WarmedUp()
    config.pluginmanager.register(Reports(), "ranger_sim reports of forked tests")
    options.check(config)
    if option(config, "coverage") and COUNTS not in os.environ:
        os.environ[COUNTS] = tempfile.mkdtemp(prefix="ranger-sim-counts-")  # for workers and branches as well
        config.stash[COUNTING] = os.environ[COUNTS]


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> int | None:
    """With --ranger-sanitize, run the same command again in a process that can hold sanitizers."""
    if option(config, "sanitize") != "yes" or config.option.help:
        return None
    from ranger_sim.firmware_sim.native import sanitizers
    from ranger_sim.foundation.user_error import UserError

    if sanitizers.is_ready():
        return None
    capture = config.pluginmanager.getplugin("capturemanager")
    if capture is not None:
        capture.stop_global_capturing()
    given = config.invocation_params
    with tempfile.TemporaryDirectory(prefix="ranger-sim-findings-") as logs:
        try:
            environment = sanitizers.environment(pathlib.Path(logs))
        except UserError as reason:
            raise pytest.UsageError(str(reason)) from None
        from ranger_sim.harness.processes import kernel

        command = [sys.executable, "-m", "pytest", *map(str, given.args)]
        return subprocess.run(
            command, cwd=given.dir, env=environment, check=False, preexec_fn=kernel.fix_addresses
        ).returncode


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Print how much of the firmware in C ran in all tests."""
    if COUNTING not in config.stash:
        return
    from ranger_sim.firmware_sim.native import coverage
    from ranger_sim.harness.testing.counts import counted

    files = counted(pathlib.Path(config.stash[COUNTING]))
    path = pathlib.Path(option(config, "coverage"))
    path.write_text(coverage.lcov(files), encoding="utf-8")
    terminalreporter.section("ranger-sim: firmware in C")
    for file in files:
        missed = f"; not run: {coverage.spans(file.missed)}" if file.missed else ""
        terminalreporter.write_line(
            f"{file.path}: {len(file.lines) - len(file.missed)} of {len(file.lines)} lines{missed}"
        )
    terminalreporter.write_line(f"written: {path}")


def pytest_unconfigure(config: pytest.Config) -> None:
    """Release what was kept."""
    for robot in config.stash[WARMED_UP].kept.values() if WARMED_UP in config.stash else ():
        robot.close()
    if COUNTING in config.stash:
        shutil.rmtree(config.stash[COUNTING], ignore_errors=True)
        os.environ.pop(COUNTS, None)


# --- running a test ---------------------------------------------------------------------------------------


def wants_shelter(item: pytest.Item) -> bool:
    """Whether a test has a board that runs C, in its own fixture.

    The program is then in the test's process, where its memory, tasks and faults are within reach; and because that
    process is the test's only, a crash ends this test and no other.
    """
    if option(item.config, "fork") == "no" or option(item.config, "scope") != "function":
        return False
    return any(
        name in getattr(item, "fixturenames", ()) and "firmware" in mark.kwargs
        for subject in subjects(item.config)
        for name in subject.marks_with_firmware
        for mark in item.iter_markers(name)
    )


def wants_branch(item: pytest.Item) -> Subject | None:
    """The kind of the machine that is a branch of one shared with other tests, or None."""
    if option(item.config, "fork") == "no" or option(item.config, "scope") != "function":
        return None
    for subject in subjects_of(item):
        if item.get_closest_marker(subject.name) is not None:
            from ranger_sim.foundation.user_error import UserError

            try:
                return subject if order_for(item, item.config, subject).branches else None
            except UserError:
                return None  # the fixture reports it
    return None


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what the backend does not support; refuse a mark that a robot of a wider scope cannot apply."""
    scope = option(item.config, "scope")
    marks = [name for subject in subjects(item.config) for name in subject.marks]
    if scope != "function" and any(mark.name in marks for mark in item.own_markers):
        pytest.fail(f"the fixtures have the scope {scope}: their marks belong there (pytestmark = ...)", pytrace=False)
    things = tuple(thing for mark in item.iter_markers("requires") for thing in mark.args)
    expects = item.get_closest_marker("expects") or item.get_closest_marker("expects_errors")
    if things or expects is not None:
        from ranger_sim.foundation.user_error import UserError
        from ranger_sim.harness.testing.backends import missing

        wrong = reason = ""
        try:
            expected = expected_of(item)
            for subject in subjects_of(item):
                subject.check(expected)
            reason = missing(backend_of(item), things)
        except UserError as mistake:
            wrong = str(mistake)
        if wrong:
            pytest.fail(wrong, pytrace=False)
        if reason:
            pytest.skip(reason)
    fork(item)


def fork(item: pytest.Item) -> None:
    """Run a test of a warmed-up robot in a forked branch of it; one of firmware in C in its own process."""
    shelter, subject = wants_shelter(item), wants_branch(item)
    if not shelter and subject is None:
        return
    from ranger_sim.harness.testing import forking

    if item.stash.get(forking.CHILD, False) or not forking.possible(item.config):
        return

    def prepare() -> bool:
        item.stash[SHELTERED] = shelter
        if not shelter and subject is not None:
            is_ready = item.config.stash[WARMED_UP].prepare(order_for(item, item.config, subject))
            item.stash[BRANCH] = subject.name if is_ready else ""
        return shelter or bool(item.stash.get(BRANCH, ""))

    if FORKED in item.stash:
        item.stash[FORKED].close()
    item.stash[FORKED] = forking.ForkedTest(item, prepare)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, Any, Any]:
    """Check a test's robots after its body: what no healthy robot does fails the test."""
    try:
        result = yield
    except Exception as error:
        if robots_of(item) and is_missing(error):
            pytest.skip(str(error))
        cut_traceback(error)
        raise
    unhealthy = []
    for watched in robots_of(item):
        unhealthy += watched.health.faults(expected_of(item))
    unhealthy += [f"firmware: {each.describe()}" for each in new_findings(item)]
    if unhealthy:
        noun = next((each.noun for each in subjects_of(item)), "machine")
        lines = [f"the {noun} is not healthy:", *(f"  {line}" for line in unhealthy)]
        pytest.fail("\n".join(lines), pytrace=False)
    return result


def new_findings(item: pytest.Item) -> list[Any]:
    """What sanitizers have found in firmware in C since the last call."""
    firmware = {each.library: each for watched in robots_of(item) for each in watched.robot.firmware.values()}
    processes = [os.getpid()]
    for watched in robots_of(item):
        forked = watched.robot.mode.forked
        processes += forked.numbers if forked is not None else ()
    for node in item.listchain():
        alone = node.stash.get(ALONE, None)
        if alone is not None and alone.firmware is not None:
            firmware[alone.firmware.library] = alone.firmware
    if not any(each.sanitize for each in firmware.values()):
        return []
    from ranger_sim.firmware_sim.native import sanitizers

    logs = sanitizers.place_of_findings()
    if logs is None:
        return []
    reported = item.config.stash.setdefault(REPORTED, {})
    new = []
    for each in sanitizers.findings(logs, [one.program for one in firmware.values()], processes):
        if each.count > reported.get(each.describe(), 0):
            new.append(each)
        reported[each.describe()] = each.count
    return new


def robots_of(item: pytest.Item) -> list[Watched]:
    """The robots that fixtures of any scope have made for a test."""
    return [watched for node in item.listchain() for watched in node.stash.get(ROBOTS, [])]


def cut_traceback(error: Exception) -> None:
    """Show a mistake in a call of ours where the test made it, without the frames of our packages."""
    from ranger_sim import loading
    from ranger_sim.foundation.user_error import UserError

    if not isinstance(error, UserError):
        return
    ours = f"{loading.PACKAGE}{os.sep}"
    entries = []
    entry = error.__traceback__
    while entry is not None:
        entries.append(entry)
        entry = entry.tb_next
    own = [each for each in entries[1:] if not each.tb_frame.f_code.co_filename.startswith(ours)]
    if own:
        own[-1].tb_next = None


def is_missing(error: Exception) -> bool:
    """Whether a test used something that its backend does not have."""
    from ranger_sim.harness.testing.backends import MissingError

    return isinstance(error, MissingError)


class Reports:
    """A separate plugin, because a module has one function for each hook: reports of forked tests.

    The reports of the test's process come before what pytest would make of the outcome here.
    """

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_makereport(self, item: pytest.Item, call: pytest.CallInfo[None]) -> pytest.TestReport | None:
        return item.stash[FORKED].report_of(call) if FORKED in item.stash else None

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Remove duplicates: plugins have added their data in both processes."""
        if vars(report).pop("forked", False):
            report.sections = list(dict.fromkeys(report.sections))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    """Add a robot's settings to its report; to that of a failure also how to repeat it, and its last events."""
    robots = robots_of(item) if call.when == "call" else []
    item.user_properties += [pair for watched in robots for pair in properties(watched)]
    report: pytest.TestReport = yield
    if robots and report.failed:
        text = "\n\n".join(description(item, watched) for watched in robots)
        report.sections.append(("ranger-sim", text))
    return report


# --- fixtures ---------------------------------------------------------------------------------------------


@pytest.fixture(scope=options.scope_of)  # type: ignore[arg-type]
def machine(request: pytest.FixtureRequest) -> Iterator[Machine]:
    """The project's own machine, made by its conftest.py and the mark `machine`, and checked after each test."""
    yield from watched_machine(request, "machine")


def watched_machine(request: pytest.FixtureRequest, fixture: str) -> Iterator[Any]:
    """The machine of a fixture, with what follows after the test."""
    from ranger_sim.foundation.user_error import UserError
    from ranger_sim.harness.testing.backends import MissingError
    from ranger_sim.harness.testing.health import Health
    from ranger_sim.harness.testing.making import made

    node, config = request.node, request.config
    missing = wrong = ""
    try:
        order: Any = order_for(node, config, config.stash[SUBJECTS][fixture])
        branch = node.stash.get(BRANCH, "") == fixture
        if getattr(order, "firmware", ()) and order.in_process is None:
            order = dataclasses.replace(order, in_process=node.stash.get(SHELTERED, False))
        robot = config.stash[WARMED_UP].kept[order] if branch else made(order)
    except MissingError as reason:
        missing = str(reason)
    except (UserError, AssertionError) as mistake:
        wrong = str(mistake)
    if missing:
        pytest.skip(missing)
    if wrong:
        pytest.fail(wrong, pytrace=False)
    watched = Watched(robot, order, Health(robot, from_power_up=not order.warmed_up))
    node.stash.setdefault(ROBOTS, []).append(watched)
    yield robot
    node.stash[ROBOTS].remove(watched)
    robot.close()
