"""Every command that takes long, on a terminal: the window closes, Ctrl-C once and twice, suspended and resumed."""

import contextlib
import json
import os
import pathlib
import pty
import re
import signal

import pytest

from examples import bench_recording
from ranger_sim.tools.commands import NAMED
from tests.system import listeners
from tests.terminals import CTRL_C, Terminal, alone

ROOT = pathlib.Path(__file__).parents[2]

SENSORS = ROOT / "campaigns" / "sensors.toml"
# name: (words, what it shows once it is at work). The first word of a name is the command.
LONG = {
    "walk": (["walk", "--steps", "100000", "--out", "kept"], "steps"),
    "up": (["up", "--name", "on-a-terminal", "--out", "kept"], "steps"),
    "campaign": (["campaign", SENSORS, "--pool", "local", "--out", "kept"], "0/"),
    "campaign with Dask": (["campaign", SENSORS, "--pool", "dask", "--jobs", "1", "--out", "kept"], "0/"),
    "diagnose": (["diagnose", "recording.csv", "--experiment", "motor-bench", "--out", "kept"], "0:00:0"),
    "identify": (["identify", "all", "--coverage", "200"], "/200"),
    "bench": (["bench", "robot", "--seconds", "5", "--runs", "100"], "run 1 of"),
    "panel": (["panel", "--walk", "--http-port", "0"], "token="),
    "bus": (["bus", "--name", "on-a-terminal"], "Ctrl-C ends"),
    "twins": (["twins", "--share", "0.05", "--work", "kept", "--out", "kept.twins"], "0/"),
    "daq": (["daq", "--port", "port", "--fast", "MCH_ANGLE"], "waiting"),
    "trace": (["trace", "open", "run.pftrace", "--no-browser"], "Ctrl-C ends"),
    "slots": (["slots", "--time", "36000s"], "the robot runs"),
    "check-bus": (["check-bus", "profile.toml", "--listen", "36000s"], "listening for"),
}
# The others: they end by themselves in seconds, whatever they are given, or wait at most so long for an answer.
SHORT = {"help", "info", "table", "ctl", "body", "can-bounds", "faults", "firmware", "new", "summary-schema", "causes",
         "fmu", "read", "completion"}  # fmt: skip
PROFILE = '[buses.can1]\ninterface = "virtual"\nchannel = "terminals"\nbit_rate = 1000000\n'
COMPLETE = ("walk", "up")  # finish their files when they are interrupted once
ENDS_WELL = {"panel": 0, "bus": 0}  # until Ctrl-C is how they are meant
INTERRUPTED = 130
HIDES_CURSOR = "\x1b[?25l"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A minute of the motor bench, as text."""
    folder = tmp_path_factory.mktemp("data")
    assert bench_recording.main([], folder, 60.0) == 0
    return (folder / "run1.csv").read_bytes()


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    """A timeline of a tenth of a second."""
    folder = tmp_path_factory.mktemp("traced")
    listeners.prepare(folder)
    return folder / "run.pftrace"


@pytest.fixture
def at_work(tmp_path, recording, request):
    """Start one of LONG by its name, and wait until it works."""
    (tmp_path / "recording.csv").write_bytes(recording)
    (tmp_path / "profile.toml").write_text(PROFILE, encoding="utf-8")
    started = []
    with contextlib.ExitStack() as stack:

        def start(name, columns=80):
            words, shown = LONG[name]
            if name == "trace":
                stack.enter_context(alone("trace-open"))
                (tmp_path / "run.pftrace").symlink_to(request.getfixturevalue("trace"))
            if name == "daq":  # a robot that sends nothing
                for descriptor in (pair := pty.openpty()):
                    stack.callback(os.close, descriptor)
                (tmp_path / "port").symlink_to(os.ttyname(pair[1]))
            terminal = Terminal(*words, folder=tmp_path, columns=columns)
            started.append(terminal)
            terminal.until(shown)
            return terminal

        yield start
        for terminal in started:
            left = terminal.left() if terminal.code is not None else []
            terminal.__exit__()
            assert not left


def files_are_complete(folder):
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["complete"] and summary["interrupted"]
    assert {"can1.log", "variables.mf4", "report.html"} <= set(summary["files"])
    assert set(summary["files"].values()) == {"complete"}


def test_every_command_takes_long_on_a_terminal_or_is_known_to_be_short():
    assert {name.split()[0] for name in LONG} | SHORT == set(NAMED)
    assert not {name.split()[0] for name in LONG} & SHORT


@pytest.mark.parametrize("name", LONG)
def test_a_command_whose_terminal_closes_ends_in_order(name, at_work, tmp_path):
    terminal = at_work(name)
    terminal.close()
    assert terminal.wait() == ENDS_WELL.get(name, INTERRUPTED)
    if name in COMPLETE:
        files_are_complete(tmp_path / "kept")


@pytest.mark.parametrize("is_suspended", [False, True])
@pytest.mark.parametrize("name", LONG)
def test_ctrl_c_ends_a_command_in_order_also_one_that_was_suspended(name, is_suspended, at_work, tmp_path):
    terminal = at_work(name)
    if is_suspended:
        terminal.suspend()
        terminal.resume()
    terminal.press(CTRL_C)
    assert terminal.wait() == ENDS_WELL.get(name, INTERRUPTED)
    assert "Traceback" not in terminal.shown and "warn" not in terminal.shown.lower()
    assert HIDES_CURSOR not in terminal.shown  # whatever ends or suspends the command leaves a terminal that has one
    if name in COMPLETE:
        files_are_complete(tmp_path / "kept")


@pytest.mark.parametrize("name", LONG)
def test_ctrl_c_twice_in_a_narrow_window_ends_a_command_without_a_traceback(name, at_work):
    terminal = at_work(name, columns=40)
    terminal.press(CTRL_C)
    terminal.press(CTRL_C)
    assert terminal.wait() in (ENDS_WELL.get(name, INTERRUPTED), INTERRUPTED, -signal.SIGINT)
    assert "Traceback" not in terminal.shown and "warn" not in terminal.shown.lower()


def test_a_campaign_that_was_interrupted_says_how_it_continues(at_work):
    terminal = at_work("campaign")
    terminal.press(CTRL_C)
    assert terminal.wait() == INTERRUPTED
    shown = " ".join(re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", terminal.shown).split())
    assert re.search(r"interrupted: \d+ of \d+ runs are kept in kept; the same command continues there", shown)
