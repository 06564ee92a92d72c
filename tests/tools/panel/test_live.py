"""What the page shows of a robot that walks: another gait after another parameter, and slots at the mark's time."""

import numpy as np
import pytest

from ranger_sim import Ranger
from tests import browser
from tests.tools.panel.test_keyboard import press
from tests.tools.panel.test_page import Hand, page_of, served

pytestmark = pytest.mark.skipif(browser.BROWSER is None, reason="no browser here")
WINDOW_S = 10.0  # of the plots, where the address says nothing else: 16 steps
SETTLED_S = 5.0  # when the gait repeats itself: let go, or given another parameter, so long ago
RATE = "P_H_PM_H_TRATE"  # the swing leg's rate that the hip motor aims at, rad/s
OF_RECORD, QUICKER = 2.0, 2.5
FINE_S = 0.4  # of a window: slots of 0.5 ms are shown one by one


@pytest.fixture(scope="module")
def walking(tmp_path_factory):
    """The page of a robot that walks."""
    with served("--walk") as (address, _), page_of(address, tmp_path_factory.mktemp("walking")) as page:
        yield page


def durations(times, angle):
    """Of each step (s), from the angle between the legs, which pass each other once in it."""
    k = np.flatnonzero(angle[:-1] * angle[1:] < 0)
    return np.diff(times[k] - angle[k] * (times[k + 1] - times[k]) / (angle[k + 1] - angle[k]))


def traces(page, place):
    """Of each channel of a plot: (3, n) with times, lowest and highest values."""
    plot = f"window.rangerPanel.plots.all().at({place})"
    page.until(f"{plot}.strip === null && {plot}.found?.length === {plot}.numbers.length")
    rows = "({ x, low, high }) => [x, low, high ?? low].map((each) => Array.from(each))"
    return [np.array(each, float) for each in page.value(f"{plot}.found.map({rows})")]


def steps_shown(page, since_s):
    """Durations of the steps that the first plot shows, once it shows WINDOW_S from a time on."""
    page.until(f"window.rangerPanel.span()[1] > {since_s + WINDOW_S}")
    Hand(page).click("#freeze", "Hold")
    assert page.value("document.querySelector('.chip span').textContent") == "hip_rad, rad"
    times, low, high = traces(page, 0)[0]
    Hand(page).click("#freeze", "Go on")
    return durations(times[times > since_s], ((low + high) / 2)[times > since_s])


def steps_of_a_robot(rate):
    """Durations of the steps of a robot without any panel, given this parameter when it walks, in as long a window."""
    robot = Ranger()
    robot.run_for(SETTLED_S)
    robot.set_parameter(RATE, rate)
    robot.run_for(SETTLED_S)
    angle = []
    for _ in range(round(WINDOW_S / 0.01)):
        robot.run_for(0.01)
        angle.append(robot.quantities()["hip_rad"])
    robot.close()
    return durations(np.arange(len(angle)) * 0.01, np.array(angle))


def test_another_parameter_gives_another_gait_and_the_plots_show_it(walking):
    hand = Hand(walking)
    before = steps_shown(walking, SETTLED_S)
    hand.view("parameters")
    field = f"document.querySelector('[aria-label={RATE}]')"
    walking.until(f"Number({field}?.value) === {OF_RECORD}")
    hand.give(f"[aria-label={RATE}]", QUICKER)
    walking.until(f"{field}.closest('tr').classList.contains('changed')")
    changed_s = walking.value("window.rangerPanel.span()[1]")
    hand.view("plots")
    after = steps_shown(walking, changed_s + SETTLED_S)
    assert len(before) > 10 and len(after) > 10
    # not one of the new steps is as quick as the slowest of the old ones
    assert before.max() < after.min()
    # and they are those of a robot without a panel: single steps spread by 10 ms, a mean of 14 by 3 ms; four of that
    assert before.mean() == pytest.approx(steps_of_a_robot(OF_RECORD).mean(), abs=0.012)
    assert after.mean() == pytest.approx(steps_of_a_robot(QUICKER).mean(), abs=0.012)
    assert walking.value("window.rangerPanel.state().ended") == ""
    hand.view("parameters")
    hand.click("#undo")
    walking.until(f"!{field}.closest('tr').classList.contains('changed') && Number({field}.value) === {OF_RECORD}")


def test_slots_and_their_lateness_at_the_mark_are_those_of_the_plots(walking):
    hand = Hand(walking)
    hand.view("plots")
    walking.until("window.rangerPanel.span()[1] > 3")
    hand.click("#add-plot")
    for name in ("slot_MCH_us", "late_MCH_us"):
        hand.give("#search", name)
        hand.click("#channels button", name)
    press(walking, "h")
    press(walking, "ArrowLeft")  # a cursor, around which is zoomed
    while np.diff(walking.value("window.rangerPanel.held()")) > FINE_S:
        press(walking, "+")
    walking.until(
        "(([begin, end]) => window.rangerPanel.plots.all().at(-1).found?.[1]?.x[0] > begin - 1e-3)"
        "(window.rangerPanel.held())"
    )
    used, late = traces(walking, -1)
    begin, end = walking.value("window.rangerPanel.held()")
    inside = np.flatnonzero((late[0] > begin) & (late[0] < end))
    k = inside[np.argmax(late[1, inside])]  # the latest of them
    assert late[0, k] == used[0, k]
    press(walking, "Escape")  # the cursor's instant would go before the mark's
    walking.value(f"window.rangerPanel.plots.setMark({late[0, k]})")
    hand.view("inside")
    hand.sees(f"text('inside-at').startsWith('at {late[0, k]:.3f} s')")
    hand.sees(f"Math.abs(state.slots.MCH.begun_s - {late[0, k]}) < 1e-6")
    shown = walking.value("window.rangerPanel.state().slots.MCH")
    assert shown["used_us"] == pytest.approx(used[1, k])
    assert shown["late_us"] == pytest.approx(late[1, k])
    assert shown["late"]["worst"] >= shown["late_us"]
    # it stands there while the robot goes on
    now_s = walking.value("window.rangerPanel.span()[1]")
    walking.until(f"window.rangerPanel.span()[1] > {now_s} + 0.5")
    assert walking.value("window.rangerPanel.state().slots.MCH") == shown
    row = "[...document.querySelectorAll('#boards tbody tr')].find((e) => e.textContent.startsWith('MCH')).innerText"
    used_us = used[1, k]
    assert (f"{used_us:.1f} µs" if used_us < 100 else f"{int(used_us + 0.5)} µs") in walking.value(row)
    press(walking, "Escape")  # and now it is now again
    hand.sees(f"state.slots.MCH.begun_s > {now_s}")


def test_nothing_jumps_when_what_is_shown_changes(walking):
    """By the browser's own measure of layout shifts: the share of the window that moved times the share of the window
    by which it did. A page that is read may have 0.1 in all (web.dev/articles/cls); each view here has a tenth in 2 s.
    """
    hand = Hand(walking)
    walking.value("""{
        window.moved = [];
        const watcher = new PerformanceObserver((list) => moved.push(...list.getEntries().map((each) => each.value)));
        watcher.observe({ type: "layout-shift" });
        0 }""")
    for view in ("plots", "inside", "errors"):
        hand.view(view)
        pictures = walking.value("window.rangerPanel.shown()")
        walking.until(f"window.rangerPanel.shown() > {pictures} + 10")  # the view is whole
        walking.value("window.moved.length = 0")
        now_s = walking.value("window.rangerPanel.span()[1]")
        walking.until(f"window.rangerPanel.span()[1] > {now_s} + 2")
        assert sum(walking.value("window.moved")) < 0.01, view
