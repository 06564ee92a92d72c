"""The files of a walk open in other people's tools, and the report in a real browser."""

import json
import pathlib
import re
import subprocess
import sys
import warnings

import cantools
import numpy as np
import pytest

from ranger_sim.can_bus.edge.candump import read_candump
from ranger_sim.datatable.generated import all_variables
from tests import browser

ROOT = pathlib.Path(__file__).resolve().parents[2]


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
    reported = json.loads((folder / "summary.json").read_text())
    assert reported["complete"] is True
    assert reported["files"] == dict.fromkeys(names - {"summary.json", "x.json"}, "complete")
    assert reported == json.loads((folder / "x.json").read_text())


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


def test_the_report_is_small_enough_to_be_sent_around(folder):
    # what a longer walk has more of is steps: a dot each, in 10 bytes
    assert (folder / "report.html").stat().st_size < 2_500_000


# Of every element: who reaches beyond the page to the right, or holds more than there is room for.
TOO_WIDE = """[...document.querySelectorAll("body *")].filter((each) => !each.closest("svg")
    && (each.getBoundingClientRect().right > document.documentElement.clientWidth + 0.5
        || ["TABLE", "SECTION", "MAIN"].includes(each.tagName) && each.scrollWidth > each.clientWidth + 1)
  ).map((each) => each.tagName + " " + each.className)"""
# The instant at which each chart over time has its mark, read off its own axis.
MARKED = """[...document.querySelectorAll("figure")].filter((each) => each.querySelector(".mark.line")
    && each.querySelector(".plot")._fullLayout.xaxis.title.text.startsWith("time")).map((each) => {
  const plot = each.querySelector(".plot"), axis = plot._fullLayout.xaxis;
  const left = each.querySelector(".mark").getBoundingClientRect().left - plot.getBoundingClientRect().left;
  return axis.p2d(left - axis._offset);
})"""
AXES = """[...document.querySelectorAll(".plot")].flatMap((each) => [each._fullLayout.xaxis.title.text,
  each._fullLayout.yaxis.title.text])"""
ROBOT = "document.getElementById('stage').toDataURL()"
SHARP = """(() => { const stage = document.getElementById("stage");
  return [stage.width, stage.height, Math.round(stage.clientWidth * 2), Math.round(stage.clientHeight * 2)]; })()"""
DRAWN = "window.rangerReport && document.documentElement.dataset.drawn =="
WIDTHS = (390, 768, 1400)  # a telephone, a tablet, a desk


@pytest.fixture(scope="module")
def page(folder, tmp_path_factory):
    """The report, open in a real browser on a telephone."""
    with browser.opened(tmp_path_factory.mktemp("profile")) as opened:
        opened.open(folder / "report.html", WIDTHS[0])
        opened.until(f"{DRAWN} {WIDTHS[0]}")
        yield opened


@pytest.mark.skipif(browser.BROWSER is None, reason="no Chromium or Chrome here to render the report in")
class TestInABrowser:
    def test_the_robot_moves_by_itself(self, page):
        page.value("rangerReport.setCursor(0)")
        begun = page.value("rangerReport.cursor()")
        page.until(f"rangerReport.cursor() > {begun}")

    def test_nothing_is_wider_than_the_page_and_the_robot_is_sharp(self, page):
        for width in WIDTHS:
            page.resize(width)
            page.until(f"{DRAWN} {width}")
            assert page.value(TOO_WIDE) == [], width
            is_wide, is_high, wide, high = page.value(SHARP)
            assert (is_wide, is_high) == (wide, high) and wide > 1.7 * min(width - 60, 1000)

    def test_every_axis_has_a_quantity_and_a_unit(self, page):
        axes = page.value(AXES)
        assert len(axes) >= 2 * 13
        assert [text for text in axes if not re.fullmatch(r"\w.* \(.+\)|board", text)] == []

    def test_pointing_at_a_chart_moves_the_robot_and_every_chart_to_that_time(self, page):
        page.value("rangerReport.setRunning(false)")
        chosen = []
        for key, share in (("hip-angle", 0.3), ("voltage", 0.6)):
            plot = f"document.querySelector('#chart-{key} .plot')"
            page.value(f"{plot}.scrollIntoView({{block: 'center'}})")
            robot = page.value(ROBOT)
            box = page.value(
                f"(() => {{ const box = {plot}.getBoundingClientRect(), axis = {plot}._fullLayout.xaxis;"
                "return [box.left + axis._offset, axis._length, box.top + box.height / 2, ...axis.range]; })()"
            )
            left, length, y, begin, end = box
            page.point(round(left + share * length), y)
            chosen.append(begin + (round(left + share * length) - left) / length * (end - begin))
            at = page.value("rangerReport.cursor()")
            assert at == pytest.approx(chosen[-1], abs=1e-6)
            pixel = (end - begin) / length
            marked = page.value(MARKED)
            assert len(marked) == 7 and marked == pytest.approx([at] * 7, abs=pixel)
            assert page.value(ROBOT) != robot
            assert page.value("document.getElementById('clock').textContent") == f"{at:.3f} s"
        assert abs(chosen[1] - chosen[0]) > 0.2

    def test_arrow_keys_move_the_cursor(self, page):
        page.value("rangerReport.setRunning(false); rangerReport.setCursor(3.0)")
        page.key("ArrowRight")
        page.key("ArrowRight", modifiers=8)  # with Shift
        page.key("ArrowLeft")
        assert page.value("rangerReport.cursor()") == pytest.approx(3.1)

    def test_the_states_are_named_where_they_are_coloured_and_the_one_now_is_marked(self, page):
        page.value("rangerReport.setRunning(false); rangerReport.setCursor(3.0)")
        for key, machine in (("hip-angle", "hip"), ("outer-ankle", "outer_foot"), ("inner-ankle", "inner_foot")):
            marked = page.value(f"[...document.querySelectorAll('#chart-{key} .states .on')].map((e) => e.textContent)")
            assert marked == [page.value(f"document.querySelector('#now-{machine} .state').textContent")]
            inside = page.value(
                f"document.querySelector('#chart-{key} .plot')._fullLayout.shapes.map((s) => s.label.text)"
            )
            assert len(set(inside) - {""}) >= 2, "wide bands have their names in them"

    def test_in_the_dark_paper_is_dark_and_ink_light_in_charts_too(self, page):
        brightness = """((text) => text.match(/\\d+/g).slice(0, 3).map(Number).reduce((a, b) => a + b) / 765)(%s)"""
        ink = brightness % "getComputedStyle(document.querySelector('#chart-current .xtitle')).fill"
        paper = brightness % "getComputedStyle(document.querySelector('section')).backgroundColor"
        assert page.value(ink) < 0.3 and page.value(paper) > 0.9
        page.colours(dark=True)
        page.until(f"{ink} > 0.7")
        assert page.value(paper) < 0.2

    def test_the_page_itself_has_no_error(self, page):
        assert page.errors == []
