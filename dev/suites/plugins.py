"""Popular pytest plugins next to ours, each alone and in pairs: a small project must have the same outcomes."""

import concurrent.futures
import dataclasses
import itertools
import os
import pathlib
import re
import subprocess
import xml.etree.ElementTree as ElementTree

from ranger_sim.foundation import wallclock

LONGEST_S = 300.0
AT_ONCE = 2  # runs; one waits for its processes a third of the time
TESTS = """\
import pytest
from hypothesis import given, settings, strategies


def test_plain():
    assert 1 + 1 == 2


def test_plain_that_fails():
    assert 1 + 1 == 3


@pytest.mark.skip(reason="left out")
def test_left_out():
    pass


@settings(max_examples=5, derandomize=True, database=None, deadline=None)
@given(strategies.integers())
def test_drawn(number):
    assert number == int(str(number))


@pytest.fixture
def noted(request):
    kept = []
    yield kept
    assert kept == [request.node.name]


@pytest.mark.ranger(seed=3, warmed_up="0.2 s")
def test_branched(ranger, noted, request):
    noted.append(request.node.name)
    ranger.until("0.25 s")
    assert ranger.time_s >= 0.25


@pytest.mark.ranger(seed=3, warmed_up="0.2 s")
def test_branched_that_fails(ranger):
    ranger.until("0.22 s")
    assert ranger.time_s > 100.0


@pytest.mark.ranger(seed=3, warmed_up="0.2 s")
def test_branched_again(ranger, tmp_path):
    assert ranger.time_s < 0.25
    (tmp_path / "file").write_text("x")


@pytest.mark.board("MCH")
def test_a_board(board):
    board.run_for("2 ms")
"""
OUTCOMES = {
    "test_plain": "passed",
    "test_plain_that_fails": "failed",
    "test_left_out": "skipped",
    "test_drawn": "passed",
    "test_branched": "passed",
    "test_branched_that_fails": "failed",
    "test_branched_again": "passed",
    "test_a_board": "passed",
}


@dataclasses.dataclass(frozen=True)
class Plugin:
    """name: of the plugin as `-p no:NAME` takes it; options: that make it work."""

    name: str
    options: tuple[str, ...] = ()


PLUGINS = {
    "xdist": Plugin("xdist", ("-n", "2")),
    "rerunfailures": Plugin("rerunfailures", ("--reruns", "1")),
    "timeout": Plugin("timeout", ("--timeout", "120")),
    "randomly": Plugin("randomly"),
    "cov": Plugin("pytest_cov", ("--cov", ".")),
    "asyncio": Plugin("asyncio"),
    "hypothesis": Plugin("hypothesispytest", ("--hypothesis-show-statistics",)),
    "repeat": Plugin("repeat", ("--count", "2")),
    "html": Plugin("html", ("--html", "report.html")),
    "instafail": Plugin("instafail", ("--instafail",)),
}


def outcomes(report: pathlib.Path) -> dict[str, set[str]]:
    """What became of each test, runs of one test together."""
    found: dict[str, set[str]] = {}
    for case in ElementTree.parse(report).getroot().iter("testcase"):
        kinds = [kind for kind in ("failure", "error", "skipped") if case.find(kind) is not None]
        outcome = {"failure": "failed"}.get(kinds[0], kinds[0]) if kinds else "passed"
        found.setdefault(re.sub(r"\[.*", "", str(case.get("name"))), set()).add(outcome)
    return found


def run(python: pathlib.Path, folder: pathlib.Path, names: tuple[str, ...]) -> str:
    """What is wrong with the project under these plugins, or "". folder: of this run alone."""
    folder.mkdir(exist_ok=True)
    (folder / "test_project.py").write_text(TESTS, encoding="utf-8")
    (folder / "pytest.ini").write_text("[pytest]\nasyncio_default_fixture_loop_scope = function\n", encoding="utf-8")
    report = folder / "report.xml"
    options = [text for name in names for text in PLUGINS[name].options]
    off = [text for name, each in PLUGINS.items() if name not in names for text in ("-p", f"no:{each.name}")]
    done = subprocess.run(
        [python, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--junitxml={report}", *off, *options],
        cwd=folder,
        env={name: value for name, value in os.environ.items() if not name.startswith(("PYTEST", "RANGER_SIM"))},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=LONGEST_S,
    )
    if done.returncode != 1 or not report.exists():
        return f"pytest ended with {done.returncode} where 1 is expected:\n{done.stdout[-1500:]}"
    found = outcomes(report)
    if "rerunfailures" in names:  # the first run of a test that fails twice is an entry without a failure
        found = {name: each - {"passed"} if "failed" in each else each for name, each in found.items()}
    wrong = {name for name in OUTCOMES.keys() | found.keys() if found.get(name) != {OUTCOMES.get(name)}}
    return "; ".join(f"{name}: {sorted(found.get(name, set()))}" for name in sorted(wrong))


def in_pairs(python: pathlib.Path, folder: pathlib.Path) -> list[str]:
    """Every plugin alone and every pair; returns the combinations that are wrong."""
    folder.mkdir(exist_ok=True)
    combinations = [(name,) for name in PLUGINS] + list(itertools.combinations(PLUGINS, 2))
    began, wrong = wallclock.monotonic_s(), []
    with concurrent.futures.ThreadPoolExecutor(AT_ONCE) as pool:
        faults = list(pool.map(lambda names: run(python, folder / "-".join(names), names), combinations))
    for names, fault in zip(combinations, faults, strict=True):
        if fault:
            print(f"    {' and '.join(names)}: {fault}", flush=True)
            wrong.append(" and ".join(names))
    right = len(combinations) - len(wrong)
    print(f"{'plugins':12} {right} of {len(combinations)} alone and in pairs, {wallclock.monotonic_s() - began:.0f} s")
    return wrong
