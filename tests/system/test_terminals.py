"""Every command that takes long, on a terminal: the window closes, Ctrl-C once and twice, suspended and resumed."""

import json
import pathlib
import re
import signal

import pytest

from examples import bench_recording
from tests.terminals import CTRL_C, Terminal

ROOT = pathlib.Path(__file__).parents[2]

# name: (words, what it shows once it is at work)
LONG = {
    "walk": (["walk", "--steps", "100000", "--out", "kept"], "steps"),
    "up": (["up", "--name", "on-a-terminal", "--out", "kept"], "steps"),
    "campaign": (["campaign", ROOT / "campaigns" / "sensors.toml", "--pool", "local", "--out", "kept"], "0/"),
    "diagnose": (["diagnose", "recording.csv", "--experiment", "motor-bench", "--out", "kept"], "0:00:0"),
    "identify": (["identify", "all", "--coverage", "200"], "/200"),
    "bench": (["bench", "robot", "--seconds", "5", "--runs", "100"], "run 1 of"),
    "panel": (["panel", "--walk", "--http-port", "0"], "token="),
    "bus": (["bus", "--name", "on-a-terminal"], "Ctrl-C ends"),
}
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


@pytest.fixture
def at_work(tmp_path, recording):
    """Start one of LONG by its name, and wait until it works."""
    (tmp_path / "recording.csv").write_bytes(recording)
    started = []

    def start(name, columns=80):
        words, shown = LONG[name]
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


@pytest.mark.parametrize("name", LONG)
def test_a_command_whose_terminal_closes_ends_in_order(name, at_work, tmp_path):
    terminal = at_work(name)
    terminal.close()
    assert terminal.wait() == ENDS_WELL.get(name, INTERRUPTED)
    if name in COMPLETE:
        files_are_complete(tmp_path / "kept")


@pytest.mark.parametrize("name", LONG)
def test_ctrl_c_ends_a_command_in_order(name, at_work, tmp_path):
    terminal = at_work(name)
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


@pytest.mark.parametrize("name", ["walk", "up", "campaign", "panel"])
def test_a_command_that_was_suspended_continues(name, at_work):
    terminal = at_work(name)
    terminal.suspend()
    terminal.resume()
    terminal.press(CTRL_C)
    assert terminal.wait() == ENDS_WELL.get(name, INTERRUPTED)
    assert "Traceback" not in terminal.shown


def test_a_campaign_that_was_interrupted_says_how_it_continues(at_work):
    terminal = at_work("campaign")
    terminal.press(CTRL_C)
    assert terminal.wait() == INTERRUPTED
    shown = " ".join(re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", terminal.shown).split())
    assert re.search(r"interrupted: \d+ of \d+ runs are kept in kept; the same command continues there", shown)
