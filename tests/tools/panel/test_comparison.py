"""A walk compared with its twins from the panel: what is refused, what a page is shown, and how the process ends."""

import asyncio
import contextlib
import os
import pathlib
import select
import signal
import sys

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools import cli
from ranger_sim.tools.panel import comparison
from ranger_sim.tools.panel.channels import EMPTY, Channel
from ranger_sim.tools.panel.comparison import Comparison
from ranger_sim.tools.panel.recording import RecordingSource
from ranger_sim.tools.panel.source import Source
from ranger_sim.tools.recordings.datasets import open_recording
from tests import browser
from tests.tools.panel.test_page import Hand, page_of, served
from tests.tools.panel.test_reader import AXE, FOUND

PATIENCE_S = 120
on_linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the kernel of Linux ends the process")


class Walks(Source):
    """Walks in files of these names."""

    def __init__(self, *paths):
        super().__init__()
        self.walks = tuple(map(str, paths))

    def recording(self, walk):
        return [self.walks[walk]]


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """The folder of a sound walk of 14 steps."""
    folder = tmp_path_factory.mktemp("walks") / "sound"
    assert cli.main(["walk", "--steps", "14", "--log", "full", "--out", str(folder)]) == 0
    return folder


def end_of(work):
    """(what a page is shown after a comparison, what it was shown on the way)."""
    shown = []

    async def run():
        made = Comparison(work, lambda: shown.append(made.content["at"]))
        made.start(0)
        async with asyncio.timeout(PATIENCE_S):
            await made.running
        return made

    return asyncio.run(run()), shown


def test_only_a_walk_of_the_source_is_compared():
    made = Comparison(Walks("a"), lambda: None)
    for number in (1, -1, True, "0", None):
        with pytest.raises(UserError, match="is not one of 1 walks"):
            made.start(number)


def test_a_comparison_shows_how_far_it_is_and_then_what_it_found(sound):
    with contextlib.closing(RecordingSource([str(sound)])) as source:
        made, shown = end_of(source)
    assert shown[0] == "recording" and "equations" in shown and shown[-1] == ""
    answer = made.content["answer"]
    assert made.content["error"] == "" and made.running is None
    assert answer["headline"] == "Nothing found" and answer["causes"] == []
    assert answer["lines"][0].startswith("10 steps at the table's rate against sound walks of record-2011")
    sizes = [abs(away) for _, away in answer["unusual"]]
    assert sizes == sorted(sizes, reverse=True) and len(sizes) == 8
    assert b"Compared with its twins" in made.report and made.report.startswith(b"<!doctype html>")


def test_what_cannot_be_compared_is_one_line(tmp_path):
    made, _ = end_of(Walks(tmp_path / "none"))
    assert "none" in made.content["error"] and "\n" not in made.content["error"]
    assert made.content["answer"] is None and made.report == b""


def test_a_comparison_that_is_stopped_leaves_no_process_and_another_may_begin(sound):
    async def run():
        begun = asyncio.Event()
        made = Comparison(Walks(sound), begun.set)
        made.start(0)
        with pytest.raises(UserError, match="is being compared"):
            made.start(0)
        while made.content["at"] == "recording":  # until the process reports something
            begun.clear()
            await begun.wait()
        (child,) = children(os.getpid())
        await made.stop()
        with pytest.raises(ProcessLookupError):
            os.kill(child, 0)
        assert made.content["error"] == "stopped" and made.running is None
        made.start(0)
        await made.stop()

    asyncio.run(run())


def children(process):
    """The processes that this one has started."""
    text = pathlib.Path(f"/proc/{process}/task/{process}/children").read_text()
    return [int(each) for each in text.split()]


def test_a_source_that_has_no_walk_offers_no_comparison(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s,MCH_ANGLE_rad\n" + "".join(f"{0.01 * n},{0.1 * n}\n" for n in range(50)))
    with contextlib.closing(RecordingSource([str(path)])) as source:
        assert "twins" not in source.can and source.walks == ()


def test_options_of_the_recording_are_those_of_the_comparison(sound):
    with contextlib.closing(RecordingSource([str(sound)], options=["--map", "A=B"])) as source:
        assert "twins" in source.can and source.recording(0) == [str(sound), "--map", "A=B"]


class Live(Source):
    """A source that keeps samples itself: a variable of the walk, a parameter, and another quantity."""

    def __init__(self):
        super().__init__()
        self.channels = [Channel(name, "rad", "", "test") for name in ("MCH_ANGLE", "C_H_GAIN", "hip_rad")]

    def span(self):
        return (0.0, 10.0)

    def samples(self, channel, begin, end):
        times = np.arange(begin, end, 0.5)
        return times, times.astype(np.float32)


def test_of_samples_that_only_the_panel_has_those_that_are_compared_become_a_file(tmp_path):
    comparison.save(Live(), tmp_path / "a.mf4")
    channels = open_recording(tmp_path / "a.mf4").channels
    assert sorted(channels) == ["C_H_GAIN", "MCH_ANGLE"]
    assert channels["MCH_ANGLE"].value.tolist() == np.arange(0.0, 10.0, 0.5).tolist()
    assert channels["C_H_GAIN"].value.tolist() == [9.0, 9.5]
    quiet = Live()
    quiet.samples = lambda channel, begin, end: (EMPTY.x, EMPTY.low)
    with pytest.raises(UserError, match="no samples"):
        comparison.save(quiet, tmp_path / "b.mf4")


@pytest.mark.skipif(browser.BROWSER is None, reason="no browser here")
def test_the_page_marks_what_is_unusual_and_names_the_cause(tmp_path):
    (tmp_path / "weak.toml").write_text(
        'base = "ranger"\n[parameters]\nhip_spring_Nm_per_rad = 6.0\n[sources]\nhip_spring_Nm_per_rad = "a test"\n'
    )
    weak = tmp_path / "weak"
    words = ["walk", "--steps", "20", "--log", "full", "--body", str(tmp_path / "weak.toml"), "--out", str(weak)]
    assert cli.main(words) == 0
    with served(str(weak)) as (address, _), page_of(address, tmp_path, 390) as page:
        hand = Hand(page)
        hand.view("twins")
        hand.click("#twins-walks button", "Compare weak with its twins")
        page.until("!document.getElementById('twins-answer').hidden")
        text = "document.getElementById('{}').textContent"
        assert page.value(text.format("twins-verdict")) == "weak: One cause found"
        cause = page.value(text.format("twins-causes"))
        assert cause.startswith("spring_value at hip_spring: stiffness_Nm_per_rad -1.")  # 6.0 for 7.6
        cells = "[...document.querySelectorAll('#twins-unusual tbody tr')].map((e) => [e.cells[2], e.cells[3], e])"
        rows = page.value(f"{cells}.map(([a, b, e]) => [a.textContent, b.textContent, !!e.querySelector('.odd')])")
        assert len(rows) == 8 and rows[0][1:] == ["unusual", True]
        assert all((word == "unusual") == is_marked for _, word, is_marked in rows)
        assert page.value("document.documentElement.scrollWidth <= innerWidth")
        page.value(AXE.read_text(encoding="utf-8") + ";0")
        for dark in (False, True):
            page.colours(dark)
            assert page.value(FOUND) == [], "dark" if dark else "light"
        report = page.value("fetch('twins.html').then((answer) => answer.text())")
        assert "Compared with its twins" in report


@on_linux
@pytest.mark.skipif(browser.BROWSER is None, reason="no browser here")
def test_a_panel_that_is_killed_takes_its_comparison_with_it(tmp_path, sound):
    with served(str(sound)) as (address, process), page_of(address, tmp_path) as page:
        hand = Hand(page)
        hand.view("twins")
        hand.click("#twins-walks button", "Compare")
        page.until("document.getElementById('twins-note').textContent.includes('equations')")
        (child,) = children(process.pid)
        watched = os.pidfd_open(child)
        process.send_signal(signal.SIGKILL)
        ended, _, _ = select.select([watched], [], [], PATIENCE_S)
        os.close(watched)
        assert ended
        page.errors.clear()  # the connection that was lost
