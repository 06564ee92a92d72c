"""The files of a walk open in other people's tools, and the report in a real browser."""

import json
import pathlib
import re
import shutil
import subprocess
import sys
import warnings

import cantools
import numpy as np
import pytest

from ranger_sim.can_bus.edge.candump import read_candump
from ranger_sim.datatable.generated import all_variables

ROOT = pathlib.Path(__file__).resolve().parents[2]
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What one short walk left behind."""
    out = tmp_path_factory.mktemp("walk")
    subprocess.run(
        [sys.executable, "-m", "ranger_sim", "walk", "--steps", "6", "--out", str(out), "--json", str(out / "x.json")],
        cwd=ROOT,
        check=True,
        capture_output=True,
        timeout=600,
    )
    return out


def test_a_walk_leaves_its_files_and_nothing_else(folder):
    names = {path.name for path in folder.iterdir()}
    assert names == {
        "can1.log",
        "can2.log",
        "can3.log",
        "can4.log",
        "variables.mf4",
        "summary.json",
        "report.html",
        "x.json",
    }
    told = json.loads((folder / "summary.json").read_text())
    assert told["complete"] is True
    assert told["files"] == dict.fromkeys(names - {"summary.json", "x.json"}, "complete")
    assert told == json.loads((folder / "x.json").read_text())


def test_the_logged_frames_decode_with_the_generated_dbc(folder):
    database = cantools.database.load_file(ROOT / "datatable/generated/can1.dbc")
    message = database.get_message_by_name("MCH_ANGLE")
    angles = []
    for _, _, identifier, _, lo, hi in read_candump(folder / "can1.log"):
        if identifier == message.frame_id:
            data = lo.to_bytes(4, "little") + hi.to_bytes(4, "little")
            angles.append(message.decode(data)["value"])
    assert len(angles) > 1000
    # a walking hip swings about as far as the appendix's 0.4 rad to either side, and its stops are at 0.61
    assert 0.2 < max(angles) < 0.62 and -0.62 < min(angles) < -0.2


def test_python_cans_own_tools_read_the_frame_logs(folder):
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "can.logconvert",
            str(folder / "can1.log"),
            str(folder / "x.json").replace("json", "asc"),
        ],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (folder / "x.asc").stat().st_size > 100_000
    (folder / "x.asc").unlink()


def test_the_variables_open_as_mdf_with_their_units(folder):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # deprecations of asammdf's own dependencies
        from asammdf import MDF

        with MDF(folder / "variables.mf4") as file:
            angle = file.get("MCH_ANGLE")
            truth = file.get("plant.hip_rad")
            assert angle.unit == "rad" and angle.comment
            assert set(all_variables.NAMES.values()) <= set(file.channels_db)
    # the table's angle follows the body's: sampled at 500 Hz, a few ms late, at most 2.5 rad/s
    followed = np.interp(angle.timestamps, truth.timestamps, truth.samples)
    assert np.abs(angle.samples - followed)[5:].max() < 0.03


def test_the_report_needs_nothing_from_outside(folder):
    page = (folder / "report.html").read_text()
    outside = re.findall(r"<(?:script|link|img|iframe)[^>]+(?:src|href)=[\"']?(?:https?:)?//", page)
    assert not outside


def test_the_report_calls_the_robots_only_what_was_measured_on_it(folder):
    beside = re.findall(r"<br>([^<]*)</span>", (folder / "report.html").read_text())
    assert "the robot: 0.35 m" in beside and "a floor: 0 N or more" in beside
    assert not [text for text in beside if re.fullmatch(r"the robot: 0( N)?", text)]


@pytest.mark.skipif(BROWSER is None, reason="no Chromium or Chrome here to render the report in")
def test_the_report_renders_in_a_browser_and_the_robot_moves(folder, tmp_path):
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync"]
    flags += ["--no-first-run", "--disable-component-update", f"--user-data-dir={tmp_path / 'profile'}"]
    flags += ["--virtual-time-budget=3000", "--dump-dom"]
    done = subprocess.run(
        [BROWSER, *flags, (folder / "report.html").as_uri()],
        capture_output=True,
        text=True,
        timeout=180,
        check=False,
    )
    dom = done.stdout
    assert dom.count('class="main-svg"') >= 7, "every plot is drawn"
    clock = float(re.search(r'id="clock">([\d.]+) s', dom).group(1))
    first = float(re.search(r'"t": \[([\d.]+)', dom).group(1))
    assert clock > first, "the animation has moved on"
