"""python -m dev.suites [NAME ...]: test suites of other projects, on python-can's `virtual` and on `ranger_sim`.

The suites come as source packages from the package index, at the versions of SUITES, and run as they are, in an
separate environment with the packages of requirements.txt. Exit code 1 when a test fails on our bus that passes on
`virtual` and is not in `EXPECTED`; also when one of EXPECTED passes. The name `libraries` runs our own tests that
compare with other people's libraries (OUR_TESTS): there none may be skipped; `plugins` runs a small project of tests
under ten popular pytest plugins, alone and in pairs. --json FILE writes the numbers.
"""

import argparse
import concurrent.futures
import dataclasses
import itertools
import json
import os
import pathlib
import subprocess
import sys
import sysconfig
import tarfile
import xml.etree.ElementTree as ElementTree

from dev.suites import plugins
from ranger_sim.foundation import wallclock

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = pathlib.Path(__file__).resolve().parent
LONGEST_S = 900.0
# plugins of the same environment, for `plugins` alone
OTHERS = ("randomly", "asyncio", "repeat", "html", "instafail", "pytest_cov")
WITHOUT = [text for name in OTHERS for text in ("-p", f"no:{name}")]
SHOWN = 40  # tests of a suite
AT_ONCE = 2  # suites: they wait for the wall clock most of the time


@dataclasses.dataclass(frozen=True)
class Suite:
    """One project's tests. environment: variables that they read; lacking: modules that
    the tests import and the source package does not have, with what they use of them; changed: a file, a line of it,
    and the line that replaces it; alone: its tests look for buses of this machine, so no other suite may have one.
    """

    package: str
    version: str
    tests: tuple[str, ...] = ("test",)
    environment: tuple[tuple[str, str], ...] = ()
    lacking: tuple[tuple[str, str], ...] = ()
    changed: tuple[str, str, str] | None = None
    alone: bool = False


SCRIPTS = ("viewer", "bridge", "logger", "player", "scripts")
SUITES = {
    "python-can": Suite(
        "python-can",
        "4.6.1",
        # the first needs a maker's library, the others put parts of their own into `virtual`
        tests=("test", *(f"--ignore=test/test_{name}.py" for name in ("interface_canalystii", *SCRIPTS))),
        environment=(("CI", "1"),),
        alone=True,
    ),
    "canopen": Suite("canopen", "2.4.1"),
    "can-isotp": Suite(
        "can-isotp",
        "2.0.7",
        tests=("test/test_can_stack.py",),  # the others use no bus
        lacking=(
            ("test/__init__.py", ""),
            (
                "test/tools.py",
                "def get_test_interface_config():\n    return {'interface': 'virtual', 'channel': 'isotp'}\n",
            ),
            (
                "test/unittest_logging.py",
                "import logging\n\nlogger = logging.getLogger('isotp')\n\n\n"
                "def configure_transport_layer(layer):\n    pass\n",
            ),
        ),
    ),
    "udsoncan": Suite(
        "udsoncan",
        "1.26.1",
        tests=("test/test_connection.py",),  # the others use no bus
        lacking=(
            ("test/__init__.py", ""),
            ("test/UdsTest.py", "import unittest\n\n\nclass UdsTest(unittest.TestCase):\n    pass\n"),
        ),
    ),
    "can-j1939": Suite("can-j1939", "2.0.12"),
}
# tests that fail on our bus and not on `virtual`, by a part of their name, with the reason
EXPECTED: dict[str, dict[str, str]] = {
    "python-can": {
        "test_restart_perodic_tasks": "it counts the entries of a queue that only `virtual` has",
        "test_content_virtual": "it looks for channels that `virtual` makes up",
        "test_count_returned": "it counts those",
        "test_sendmsg_preserve_timestamp": "an option of `virtual` alone",
    },
    "can-isotp": {"test_1000_error_frames": "an error frame is not a message that a controller can send"},
}


# our tests beside other people's libraries
OUR_TESTS = (
    "tests/harness/xcp/test_pyxcp.py",
    "tests/tools/fmu/test_unit.py",
    "tests/datatable/test_a2l_file.py",
    "tests/test_examples.py::test_the_example_of_co_simulation_lets_the_robot_fall_six_times",
)
LIBRARIES, PLUGINS = "libraries", "plugins"
# tests whose outcome depends on which thread comes first
RACES = {
    "canopen": dict.fromkeys(
        ("test_time_producer", "test_scanner_search_limit"), "it reads the bus while a Notifier reads it"
    )
}


@dataclasses.dataclass(frozen=True)
class Outcome:
    """passed, failed: names of tests; seconds: of the wall clock."""

    passed: frozenset[str]
    failed: frozenset[str]
    seconds: float


def environment(folder: pathlib.Path) -> pathlib.Path:
    """The interpreter of an environment that has our packages and those of requirements.txt."""
    python = folder / "bin" / "python"
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    [packages] = (folder / "lib").glob("python*/site-packages")
    (packages / "ours.pth").write_text(f"{ROOT}\n{sysconfig.get_path('purelib')}\n", encoding="utf-8")
    options = ["--disable-pip-version-check", "--no-deps", "-r", str(HERE / "requirements.txt")]
    subprocess.run([python, "-m", "pip", "install", "-q", *options], check=True)
    return python


def unpacked(suite: Suite, folder: pathlib.Path) -> pathlib.Path:
    """The folder of a suite's source package."""
    wanted = f"{suite.package}=={suite.version}"
    options = ["--disable-pip-version-check", "--no-deps", "--no-binary", ":all:", "-d", str(folder), wanted]
    subprocess.run([sys.executable, "-m", "pip", "download", "-q", *options], check=True)
    [archive] = folder.glob(f"*{suite.version}.tar.gz")
    with tarfile.open(archive) as file:
        file.extractall(folder, filter="data")
    [top] = [each for each in folder.iterdir() if each.is_dir()]
    for name, text in suite.lacking:
        (top / name).write_text(text, encoding="utf-8")
    if suite.changed:
        name, line, replacement = suite.changed
        text = (top / name).read_text(encoding="utf-8")
        assert line in text, f"{name} has no {line!r}"
        (top / name).write_text(text.replace(line, replacement), encoding="utf-8")
    return top


def run(python: pathlib.Path, suite: Suite, top: pathlib.Path, on_ours: bool) -> Outcome:
    """The suite's outcome on `virtual`, or on our bus."""
    report = top / f"{'ours' if on_ours else 'virtual'}.xml"
    options = [
        "-q",
        "-o",
        "addopts=",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:ranger_sim",
        *WITHOUT,
        "--timeout=60",
        f"--junitxml={report}",
    ]
    if on_ours:
        options += ["-p", "on_our_bus"]
    path = os.pathsep.join(map(str, (HERE, top)))
    began = wallclock.monotonic_s()
    with (top / f"{report.stem}.txt").open("wb") as printed:
        subprocess.run(
            [python, "-m", "pytest", *options, *suite.tests],
            cwd=top,
            env={**os.environ, **dict(suite.environment), "PYTHONPATH": path},
            stdout=printed,
            stderr=subprocess.STDOUT,
            check=False,
            timeout=LONGEST_S,
        )
    passed: set[str] = set()
    failed: set[str] = set()
    for case in ElementTree.parse(report).getroot().iter("testcase"):
        name = f"{case.get('classname')}::{case.get('name')}"
        if case.find("skipped") is None:
            (failed if case.find("failure") is not None or case.find("error") is not None else passed).add(name)
    return Outcome(frozenset(passed), frozenset(failed), wallclock.monotonic_s() - began)


def ours_beside_libraries(python: pathlib.Path, folder: pathlib.Path) -> list[str]:
    """What is wrong with our own tests that need other people's libraries: failed, or skipped."""
    folder.mkdir(exist_ok=True)
    report = folder / "libraries.xml"
    done = subprocess.run(
        [
            python,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            *WITHOUT,
            f"--junitxml={report}",
            *OUR_TESTS,
        ],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=LONGEST_S,
    )
    cases = list(ElementTree.parse(report).getroot().iter("testcase"))
    wrong = [str(case.get("name")) for case in cases if list(case) and case.find("system-out") is None]
    print(f"{LIBRARIES:12} {len(cases) - len(wrong)} of {len(cases)} of our tests with other people's libraries")
    if wrong or done.returncode:
        print(done.stdout[-3000:])
    return wrong or [f"pytest ended with {done.returncode}"] * (done.returncode != 0)


def compared(
    python: pathlib.Path, name: str, folder: pathlib.Path
) -> tuple[str, list[str], dict[str, object], list[str]]:
    """A suite on both buses, one after the other: its name, lines to print, numbers, and what is wrong."""
    suite = SUITES[name]
    folder = folder / name
    folder.mkdir(exist_ok=True)
    top = unpacked(suite, folder)
    virtual, ours = (run(python, suite, top, on_ours) for on_ours in (False, True))
    count = len(virtual.passed | virtual.failed)
    numbers: dict[str, object] = {"version": suite.version, "tests": count, "virtual": len(virtual.passed)}
    numbers |= {"ranger_sim": len(ours.passed), "seconds": [virtual.seconds, ours.seconds]}
    taken = f"{virtual.seconds:.0f}, {ours.seconds:.0f}"
    lines = [f"{name:12} {len(virtual.passed):5} of {count:4} {len(ours.passed):5} of {count:4} {taken:>16}"]
    wrong: list[str] = []
    only_ours = sorted((virtual.passed - ours.passed) | (ours.failed - virtual.failed))
    expected, races = EXPECTED.get(name, {}), RACES.get(name, {})
    if any(not any(part in test for part in expected | races) for test in only_ours):
        # their tests wait for the wall clock: one that passes the second time was late
        again = run(python, suite, top, on_ours=True)
        only_ours = [test for test in only_ours if test not in again.passed]
    for test in only_ours[:SHOWN]:
        reason = next((text for part, text in (expected | races).items() if part in test), None)
        lines.append(f"    {test}: {reason or 'fails on our bus only'}")
        wrong += [test] * (reason is None)
    for part in expected:
        if not any(part in test for test in only_ours):
            lines.append(f"    {part}: passes now; take it out of EXPECTED")
            wrong.append(part)
    if not count:
        wrong.append(f"{name}: no test ran")
    return name, lines, numbers, wrong


def main(arguments: list[str] | None = None) -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m dev.suites", description=__doc__.partition("\n")[0])
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"of {', '.join((*SUITES, LIBRARIES, PLUGINS))}; default: all"
    )
    parser.add_argument("--json", type=pathlib.Path, metavar="FILE", help="write the numbers")
    parser.add_argument("--folder", type=pathlib.Path, default=ROOT / "build" / "suites", help="where they are run")
    options = parser.parse_args(arguments)
    known = [*SUITES, LIBRARIES, PLUGINS]
    unknown = sorted(set(options.names) - set(known))
    if unknown:
        parser.error(f"unknown suite {unknown[0]!r} (available: {', '.join(known)})")
    names = options.names or known
    options.folder.mkdir(parents=True, exist_ok=True)
    python = environment(options.folder / "environment")
    numbers: dict[str, dict[str, object]] = {}
    wrong: list[str] = []
    if LIBRARIES in names:
        names.remove(LIBRARIES)
        wrong += ours_beside_libraries(python, options.folder)
    if PLUGINS in names:
        names.remove(PLUGINS)
        wrong += plugins.in_pairs(python, options.folder / PLUGINS)
    print(f"{'suite':12} {'virtual':>12} {'ranger_sim':>12} {'seconds':>16}")
    names.sort(key=lambda name: not SUITES[name].alone)
    for alone, group in itertools.groupby(names, lambda name: SUITES[name].alone):
        with concurrent.futures.ThreadPoolExecutor(1 if alone else AT_ONCE) as pool:
            for name, lines, found, faults in pool.map(lambda name: compared(python, name, options.folder), group):
                print("\n".join(lines), flush=True)
                numbers[name] = found
                wrong += faults
    if options.json:
        options.json.write_text(json.dumps(numbers, indent=2) + "\n", encoding="utf-8")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
