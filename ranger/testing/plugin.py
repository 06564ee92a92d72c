"""The pytest plugin: fixtures `ranger`, `machine`, `board`, `can_bus`, markers, options, reports; see docs/testing.md.

Every pytest run imports this module, so it imports nothing of the robot before a fixture needs it.
"""

from __future__ import annotations

import dataclasses
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Generator, Iterator
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from ranger_sim.harness.machine import Machine
    from ranger_sim.harness.testing.forking import ForkedTest
    from ranger_sim.harness.testing.health import Expected, Health
    from ranger_sim.harness.testing.making import Order
    from ranger_sim.ranger.robot import Ranger
    from ranger_sim.ranger.testing.bench import BoardAlone, BusAlone

FIXTURES = ("ranger", "machine")  # that give a whole machine, monitored
SCOPES = ("function", "class", "module", "package", "session")
MOST_KEPT = 8  # warmed-up robots kept for branching, some 30 MB each; chosen by us
LAST_FRAMES = 12  # in the report of a failure
LAST_ERRORS = 8
COUNTS = "RANGER_SIM_COUNTS"  # variable of the environment: the folder of what ran, as long as the tests run

# option: (environment variable, default, help)
OPTIONS = {
    "backend": ("RANGER_SIM_BACKEND", "sim", "sim, processes, vcan or hardware"),
    "profile": ("RANGER_SIM_PROFILE", "", "profile of boards and buses: a name or a .toml file"),
    "seed": ("RANGER_SIM_SEED", "", "seed of every robot, instead of the test's own"),
    "scope": ("RANGER_SIM_SCOPE", "function", f"scope of the fixtures: {', '.join(SCOPES)}"),
    "speed": ("RANGER_SIM_SPEED", "1.0", "virtual seconds per second, on vcan and hardware"),
    "fork": ("RANGER_SIM_FORK", "yes", "no: warmed-up robots are not branched, each test warms up its own"),
    "sanitize": ("RANGER_SIM_SANITIZE", "no", "yes: firmware in C with sanitizers; a test fails with what they find"),
    "coverage": ("RANGER_SIM_COVERAGE", "", "count which lines of firmware in C run, into this file (lcov.info)"),
    "trace": ("RANGER_SIM_TRACE", "", "folder for a timeline of the last 10 s of every robot whose test fails"),
}

MARKERS = (
    "ranger(seed=1, controller=..., body=..., warmed_up='step 3', backend=..., quirks=..., profile=...): "
    "the robot of the fixture `ranger`; also any other field of Scenario",
    "machine(seed=1, warmed_up='angle_rad > 1', ...): the machine of the fixture `machine`, which the project's "
    "conftest.py makes in pytest_machine(wanted)",
    "board(name, quirks=..., network_time=True): the board of the fixture `board`",
    "can_bus(bit_rate=...): the bus of the fixture `can_bus`",
    "requires(thing, ...): the test is skipped where the backend has not that thing",
    "expects_errors(name, ...): errors that the robot must show in this test; MCH:AE_SPIKE for one board",
    "expects(overruns=..., lost_frames=..., bus_errors=..., bus_off=..., dead=..., fall=..., idle_faults=...): "
    "what else must happen",
)


class Watched:
    """A machine that a fixture has made, with what the report of a test about it needs."""

    def __init__(self, robot: Machine, order: Order, health: Health) -> None:
        self.robot = robot
        self.order = order
        self.health = health


class WarmedUp:
    """Robots of this process that have been warmed up once, to be branched by forking. They never run on."""

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
ALONE = pytest.StashKey[Any]()
REPORTED = pytest.StashKey[dict[Any, int]]()
ROBOTS = pytest.StashKey[list[Watched]]()
BRANCH = pytest.StashKey[bool]()
FORKED: pytest.StashKey[ForkedTest] = pytest.StashKey()  # of a test that runs in its own process, in the parent
SHELTERED = pytest.StashKey[bool]()  # in its own process, in which programs in C run as well


# --- options ----------------------------------------------------------------------------------------------


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options; each has an environment variable, which the command line overrides."""
    group = parser.getgroup("ranger-sim", "emulated Ranger robot")
    for name, (variable, default, text) in OPTIONS.items():
        group.addoption(
            f"--ranger-{name}",
            default=None,
            metavar=name.upper(),
            help=f"{text} (default {default or 'none'}; environment: {variable})",
        )


def option(config: pytest.Config, name: str) -> str:
    """The value on the command line, in the environment, or the default."""
    variable, default, _ = OPTIONS[name]
    given = config.getoption(f"ranger_{name}", None)
    return given if given is not None else os.environ.get(variable) or default


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    """Add the hooks that a conftest.py may implement."""
    from ranger_sim.harness.testing import hooks

    pluginmanager.add_hookspecs(hooks)


def pytest_configure(config: pytest.Config) -> None:
    """Register markers, and check options."""
    for marker in MARKERS:
        config.addinivalue_line("markers", marker)
    config.stash[WARMED_UP] = WarmedUp()
    config.pluginmanager.register(Reports(), "ranger_sim reports of forked tests")
    if option(config, "scope") not in SCOPES:
        raise pytest.UsageError(f"--ranger-scope is {option(config, 'scope')!r}, allowed are {', '.join(SCOPES)}")
    for name in ("fork", "sanitize"):
        if option(config, name) not in ("yes", "no"):
            raise pytest.UsageError(f"--ranger-{name} is {option(config, name)!r}, allowed are yes, no")
    if option(config, "coverage") and COUNTS not in os.environ:
        os.environ[COUNTS] = tempfile.mkdtemp(prefix="ranger-sim-counts-")  # for workers and branches as well
        config.stash[COUNTING] = os.environ[COUNTS]
    for name, kind in (("seed", int), ("speed", float)):
        try:
            kind(option(config, name) or "1")
        except ValueError:
            raise pytest.UsageError(f"--ranger-{name} is {option(config, name)!r}, a number is expected") from None


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
    from ranger_sim.ranger.testing.robots import counted

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


def scope_of(fixture_name: str, config: pytest.Config) -> str:
    """The scope of the fixtures that make robots and boards."""
    return option(config, "scope")


def order_for(node: Any, config: pytest.Config, fixture: str = "ranger") -> Order:
    """The machine that a test (module, class) requests by its marks and the options. UserError for a wrong mark.

    fixture: `ranger`, or `machine`, the project's own.
    """
    from ranger_sim.foundation.user_error import UserError

    wanted: dict[str, Any] = {"trace": bool(option(config, "trace"))}
    if fixture == "ranger":
        wanted["backend"] = option(config, "backend")
        wanted["profile"] = option(config, "profile") or None
        wanted["speed"] = float(option(config, "speed"))
        wanted["sanitize"] = option(config, "sanitize") == "yes"
        wanted["counts"] = os.environ.get(COUNTS, "")
    for mark in reversed(list(node.iter_markers(fixture))):
        if mark.args:
            raise UserError(f"mark {fixture}: {mark.args[0]!r} has no name; it reads like {fixture}(seed=3)")
        wanted |= mark.kwargs
    if option(config, "seed"):
        wanted["seed"] = int(option(config, "seed"))
    if fixture == "ranger":
        from ranger_sim.ranger.testing.robots import order_of

        return order_of(wanted)
    from ranger_sim.harness.testing.making import machine_order

    return machine_order(Maker(node.ihook), wanted)


class Maker:
    """Makes machines by a folder's conftest.py. Two that make them by the same functions are equal."""

    def __init__(self, hook: Any) -> None:
        self.hook = hook
        self.functions = tuple(each.function for each in hook.pytest_machine.get_hookimpls())

    def __call__(self, **wanted: Any) -> Machine:
        from ranger_sim.foundation.user_error import UserError

        machine: Machine | None = self.hook.pytest_machine(wanted=wanted)
        if machine is None:
            raise UserError("fixture machine: conftest.py must choose it: def pytest_machine(wanted): return ...")
        return machine

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Maker) and other.functions == self.functions

    def __hash__(self) -> int:
        return hash(self.functions)


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
        for name in ("ranger", "board")
        for mark in item.iter_markers(name)
    )


def wants_branch(item: pytest.Item) -> str:
    """The fixture whose machine is a branch of one shared with other tests; empty: none."""
    if option(item.config, "fork") == "no" or option(item.config, "scope") != "function":
        return ""
    for fixture in FIXTURES:
        if fixture in getattr(item, "fixturenames", ()) and item.get_closest_marker(fixture) is not None:
            from ranger_sim.foundation.user_error import UserError

            try:
                return fixture if order_for(item, item.config, fixture).branches else ""
            except UserError:
                return ""  # the fixture reports it
    return ""


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what the backend does not support; refuse a mark that a robot of a wider scope cannot apply."""
    scope = option(item.config, "scope")
    if scope != "function" and any(mark.name in ("ranger", "machine", "board", "can_bus") for mark in item.own_markers):
        pytest.fail(f"the fixtures have the scope {scope}: their marks belong there (pytestmark = ...)", pytrace=False)
    things = tuple(thing for mark in item.iter_markers("requires") for thing in mark.args)
    expects = item.get_closest_marker("expects") or item.get_closest_marker("expects_errors")
    if things or expects is not None:
        from ranger_sim.foundation.user_error import UserError
        from ranger_sim.harness.testing.backends import missing

        wrong = reason = ""
        try:
            expected = expected_of(item)
            if uses_ranger(item):
                from ranger_sim.ranger import names as ranger_names
                from ranger_sim.ranger import wiring

                expected.check(ranger_names.RANGER, wiring.BOARDS)
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
    shelter, fixture = wants_shelter(item), wants_branch(item)
    if not shelter and not fixture:
        return
    from ranger_sim.harness.testing import forking

    if item.stash.get(forking.CHILD, False) or not forking.possible(item.config):
        return

    def prepare() -> bool:
        item.stash[SHELTERED] = shelter
        item.stash[BRANCH] = not shelter and item.config.stash[WARMED_UP].prepare(order_for(item, item.config, fixture))
        return shelter or item.stash[BRANCH]

    if FORKED in item.stash:
        item.stash[FORKED].close()
    item.stash[FORKED] = forking.ForkedTest(item, prepare)


def backend_of(item: pytest.Item) -> str:
    """The backend of a test: that of its mark, or the option."""
    for mark in item.iter_markers("ranger"):
        if "backend" in mark.kwargs:
            return str(mark.kwargs["backend"])
    return option(item.config, "backend")


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
        pytest.fail(
            "\n".join(
                [
                    "the robot is not healthy:" if uses_ranger(item) else "the machine is not healthy:",
                    *(f"  {line}" for line in unhealthy),
                ]
            ),
            pytrace=False,
        )
    return result


def uses_ranger(item: pytest.Item) -> bool:
    """Whether the test is about Ranger."""
    return "ranger" in getattr(item, "fixturenames", ())


def new_findings(item: pytest.Item) -> list[Any]:
    """What sanitizers have found in firmware in C since the last call."""
    firmware = {
        each.library: each for watched in robots_of(item) for each in getattr(watched.robot, "firmware", {}).values()
    }
    processes = [os.getpid()]
    for watched in robots_of(item):
        remote = getattr(watched.robot, "processes", None)
        processes += remote.numbers if remote is not None else ()
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
    rooms = tuple(f"{loading.PACKAGE / room}{os.sep}" for room in ("harness", "ranger", "foundation", "datatable"))
    entries = []
    entry = error.__traceback__
    while entry is not None:
        entries.append(entry)
        entry = entry.tb_next
    own = [each for each in entries[1:] if not each.tb_frame.f_code.co_filename.startswith(rooms)]
    if own:
        own[-1].tb_next = None


def is_missing(error: Exception) -> bool:
    """Whether a test used something that its backend does not have."""
    from ranger_sim.harness.testing.backends import MissingError

    return isinstance(error, MissingError)


def expected_of(item: pytest.Item) -> Expected:
    """What must happen by the marks of a test. UserError for a wrong mark."""
    import dataclasses

    from ranger_sim.foundation.user_error import UserError
    from ranger_sim.harness.testing.health import Expected

    errors = tuple(name for mark in item.iter_markers("expects_errors") for name in mark.args)
    others: dict[str, Any] = {}
    for mark in reversed(list(item.iter_markers("expects"))):
        others |= mark.kwargs
        if mark.args:
            raise UserError(f"mark expects: {mark.args[0]!r} has no name; it reads like expects(fall=True)")
    if any(mark.kwargs for mark in item.iter_markers("expects_errors")):
        raise UserError('mark expects_errors: it takes names only, as expects_errors("MCH:AE_SPIKE")')
    allowed = [field.name for field in dataclasses.fields(Expected) if field.name != "errors"]
    if unknown := [name for name in others if name not in allowed]:
        raise UserError(f"mark expects({unknown[0]}=...): what can be expected is {', '.join(allowed)}")
    return Expected(errors, **others)


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


def properties(watched: Watched) -> list[tuple[str, object]]:
    """A robot's properties for JUnit XML."""
    from ranger_sim import __version__, loading

    found: list[tuple[str, object]] = [
        ("ranger_sim_version", __version__),
        ("ranger_sim_runs", "compiled" if loading.RUNS_COMPILED else "interpreted"),
        ("ranger_sim_table", watched.robot.names.hash),
        ("ranger_sim_backend", watched.order.backend),
        ("ranger_sim_seed", watched.order.seed),
    ]
    return found + [(figure.name, figure.text()) for figure in watched.robot.observed.figures]


def description(item: pytest.Item, watched: Watched) -> str:
    """Seed, command, last events, and the trace, for the reader of a failure."""
    robot, order = watched.robot, watched.order
    command = ["pytest", item.nodeid, *order.arguments()]
    where = robot.whereabouts().replace(", in ", ", ")
    lines = [
        f"{order.describe()}; {robot.time_s:.6f} s since power-up{where}",
        f"once more: {shlex.join(command)}",
        *(f"also: {line}" for line in ([] if robot.lost else watched.health.faults(expected_of(item)))),
        "last errors that boards sent, beyond what is normal:",
        *last_errors(robot),
        "last frames:",
        *([f"  {frame.text()}" for frame in robot.observed.keeper.latest(LAST_FRAMES)] or ["  none"]),
    ]
    return "\n".join(lines + trace_of(item, watched))


def last_errors(robot: Machine) -> list[str]:
    """The last error frames, without those of errors that are normal on their board."""
    names, keeper = robot.names, robot.observed.keeper
    numbers = names.error_variables()
    frames = sorted(frame for bus in keeper.streams for frame in keeper.frames(bus, numbers))
    found = [f"  {frame.text()}" for frame in frames if not names.is_normal(frame.lo)]
    return found[-LAST_ERRORS:] or ["  none"]


def trace_of(item: pytest.Item, watched: Watched) -> list[str]:
    """The last seconds of a failed test as a timeline, where requested: its path, or why it is missing."""
    timeline = watched.robot.observed.timeline
    if timeline is None:
        return []
    from ranger_sim.foundation.user_error import UserError

    folder = pathlib.Path(option(item.config, "trace"))
    path = folder / (re.sub(r"[^\w.-]+", "_", item.nodeid) + ".pftrace")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        timeline.write(path)
    except (UserError, OSError) as reason:
        return [f"no trace: {reason}"]
    return [f"trace: ranger-sim trace open {shlex.quote(str(path))}"]


# --- fixtures ---------------------------------------------------------------------------------------------


@pytest.fixture(scope=scope_of)  # type: ignore[arg-type]
def ranger(request: pytest.FixtureRequest) -> Iterator[Ranger]:
    """A robot by the mark `ranger`: new, or warmed up. Its health is checked after each test."""
    yield from watched_machine(request, "ranger")


@pytest.fixture(scope=scope_of)  # type: ignore[arg-type]
def machine(request: pytest.FixtureRequest) -> Iterator[Machine]:
    """The project's own machine, made by its conftest.py and the mark `machine`; checked as the robot is."""
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
        order: Any = order_for(node, config, fixture)
        branch = node.stash.get(BRANCH, False)
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


@pytest.fixture(scope=scope_of)  # type: ignore[arg-type]
def board(request: pytest.FixtureRequest) -> Iterator[BoardAlone]:
    """A single board, by the mark `board`: `@pytest.mark.board("MCH")`."""
    from ranger_sim.foundation.user_error import UserError

    mark = request.node.get_closest_marker("board")
    wrong = 'fixture board: which one? @pytest.mark.board("MCH")'
    if mark is not None and mark.args:
        try:
            alone, wrong = board_alone(mark, request.config), ""
        except (UserError, TypeError) as mistake:
            wrong = str(mistake)
    if wrong:
        pytest.fail(wrong, pytrace=False)
    request.node.stash[ALONE] = alone
    yield alone
    request.node.stash[ALONE] = None
    if alone.firmware is not None:
        alone.chip.write_counts()


def board_alone(mark: pytest.Mark, config: pytest.Config) -> BoardAlone:
    """The board of a mark."""
    from ranger_sim.ranger.testing.bench import BoardAlone
    from ranger_sim.ranger.testing.robots import built

    wanted = dict(mark.kwargs)
    if "firmware" in wanted:
        wanted["firmware"] = built(wanted["firmware"], option(config, "sanitize") == "yes", os.environ.get(COUNTS, ""))
    return BoardAlone(*mark.args, **wanted)


@pytest.fixture(scope=scope_of)  # type: ignore[arg-type]
def can_bus(request: pytest.FixtureRequest) -> Iterator[BusAlone]:
    """A single bus with the test's own nodes: `can_bus.node("a")`."""
    from ranger_sim.foundation.user_error import UserError
    from ranger_sim.ranger.testing.bench import BusAlone

    mark = request.node.get_closest_marker("can_bus")
    wrong = ""
    try:
        alone = BusAlone(*(mark.args if mark is not None else ()), **(mark.kwargs if mark is not None else {}))
    except (UserError, TypeError) as mistake:
        wrong = f"mark can_bus: {mistake}"
    if wrong:
        pytest.fail(wrong, pytrace=False)
    yield alone
