"""The page in a real browser, on recordings: their time is the reader's, so that none of it keeps a pace."""

import json

import pytest

from ranger_sim import Ranger
from ranger_sim.tools import cli
from tests import browser
from tests.tools.panel.test_page import Hand, page_of, served

pytestmark = pytest.mark.skipif(browser.BROWSER is None, reason="no browser here")


@pytest.mark.parametrize("width", [390, 768, 1400])
def test_a_recording_is_scrubbed_and_nothing_is_wider_than_the_window(tmp_path, width):
    assert cli.main(["walk", "--time", "3s", "--log", "full", "--out", str(tmp_path / "run")]) == 0
    with served(str(tmp_path / "run")) as (address, _), page_of(address, tmp_path, width) as page:
        Hand(page).give("#position", 2.5)
        page.until("document.getElementById('clock').textContent === '2.500 s'")
        assert page.value("document.documentElement.scrollWidth <= innerWidth")
        shown = page.value("Array.from(window.rangerPanel.pose())")
        page.until("document.querySelector('.chip b').textContent !== ''")
        body = page.value("document.querySelector('.chip b').textContent")
        robot = Ranger()
        robot.run_for(2.5)
        assert float(body) == pytest.approx(robot.quantities()["hip_rad"], abs=1e-4)
        assert shown[4] == pytest.approx(robot.quantities()["hip_x_m"], abs=0.01)
        robot.close()
        assert json.loads(page.value("JSON.stringify(window.rangerPanel.held())"))[0] <= 2.5
        page.value("window.rangerPanel.plots.setMark(2.5)")  # a note stands at the mark, and in the address
        Hand(page).give("#note", "a step")
        Hand(page).click("#note-form button", "Keep")
        assert page.value("new URLSearchParams(location.hash.slice(1)).get('notes')") == '[[2.5,"a step"]]'
        assert page.value("document.querySelector('#notes button').textContent") == "2.500 s: a step"
        # what is selected is saved as it came
        page.value("document.getElementById('save-csv').onclick()")
        saved = page.value("fetch(document.getElementById('save-csv').href).then((answer) => answer.text())")
        assert saved.startswith("time_s,channel,unit,value") and saved.count("hip_rad") > 1000


def test_the_inside_view_of_a_recording_is_at_the_time_to_which_it_is_scrubbed(tmp_path):
    """Frames and loads on the page against those that the robot of the same walk had at that time."""
    assert cli.main(["walk", "--time", "2s", "--log", "full", "--out", str(tmp_path / "run")]) == 0
    robot = Ranger(log="full")
    robot.run_for(1.6)
    frames = robot.logbook.frames()
    meters = {bus.name: bus.load.windows() for bus in robot.buses}
    robot.close()
    column = "[...document.querySelectorAll('#frames tbody tr')].map((row) => row.cells[1].textContent)"
    load = "document.querySelector('#buses tbody tr:nth-child(2) .number').textContent"
    with served(str(tmp_path / "run")) as (address, _), page_of(address, tmp_path) as page:
        hand = Hand(page)
        hand.view("inside")
        page.until("document.querySelectorAll('#buses tbody tr').length === 4")
        hand.give("#bus", "can2")
        for at in (1.505, 0.705):  # back as well
            hand.give("#position", at)
            until = (frames["bus"] == 1) & (frames["time_ns"] <= round(at * 1e9))
            identifiers = [str(each) for each in frames["identifier"][until][::-1][:40]]
            page.until(f"JSON.stringify({column}) === {json.dumps(json.dumps(identifiers, separators=(',', ':')))}")
            assert page.value("document.getElementById('inside-at').textContent") == f"at {at:.3f} s"
            ended = round(100 * at - 0.5)  # windows of 10 ms
            assert float(page.value(load).split()[0]) == pytest.approx(100 * meters["can2"][ended - 1], abs=0.07)
        assert "keeps no slots" in page.value("document.getElementById('boards').textContent")


def test_two_runs_lie_over_each_other_and_are_shown_from_their_beginning(tmp_path):
    runs = [tmp_path / "before", tmp_path / "after"]
    for seed, run in enumerate(runs, start=1):
        assert cli.main(["walk", "--time", "2s", "--seed", str(seed), "--log", "full", "--out", str(run)]) == 0
    with served(*map(str, runs)) as (address, _), page_of(address, tmp_path) as page:
        names = "[...p.element.querySelectorAll('.chip span')].map((e) => e.textContent.split(',')[0])"
        plots = page.value(f"window.rangerPanel.plots.all().map((p) => {names})")
        assert plots[0] == ["hip_rad", "hip_rad (after)"] and all(len(plot) == 2 for plot in plots)
        page.until("document.getElementById('clock').textContent === '0.000 s'")
        held = "[...document.querySelectorAll('.chip b')].slice(0, 2).map((e) => e.textContent)"
        page.until(f'JSON.stringify({held}) === \'["0.35000","0.35000"]\'')  # rad: the pose in which it is let go
        box = page.value("JSON.stringify(document.querySelector('.u-over').getBoundingClientRect())")
        left, top = (json.loads(box)[key] for key in ("left", "top"))
        page.point(left + 300, top + 30)
        page.until("window.rangerPanel.plots.cursor() > 0.5")
        page.point(5, 5)  # away from the plots: what stands where it is played is shown again
        page.until(f'JSON.stringify({held}) === \'["0.35000","0.35000"]\'')
