"""The page by the keyboard alone, and what it says to who does not see it, in a real browser."""

import pytest

from tests import browser
from tests.tools.panel.test_page import Hand, page_of, served

pytestmark = pytest.mark.skipif(browser.BROWSER is None, reason="no browser here")
SHIFT = 8  # Input.dispatchKeyEvent
# Names of keys as the page has them, and as the protocol wants them.
CODES = {"Enter": 13, "Tab": 9, "Escape": 27, "Home": 36, "End": 35, "Delete": 46}
CODES |= {"ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40}


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A walk of 3 s."""
    from ranger_sim.tools import cli

    folder = tmp_path_factory.mktemp("run") / "run"
    assert cli.main(["walk", "--time", "3s", "--log", "full", "--out", str(folder)]) == 0
    return folder


def press(page, key, modifiers=0):
    """A key as a person presses it: one that writes a sign says which."""
    text = {"Enter": "\r"}.get(key, key if len(key) == 1 else "")
    common = {"key": key, "modifiers": modifiers, "windowsVirtualKeyCode": CODES.get(key, 0)}
    page.call("Input.dispatchKeyEvent", type="keyDown" if text else "rawKeyDown", text=text, **common)
    page.call("Input.dispatchKeyEvent", type="keyUp", **common)


def focus(page):
    """What has the focus, by its name."""
    return page.value("(document.activeElement.ariaLabel ?? document.activeElement.textContent).trim()")


def plots(page):
    """The names in each plot."""
    names = "[...p.element.querySelectorAll('.chip span')].map((e) => e.textContent.split(',')[0])"
    return page.value(f"window.rangerPanel.plots.all().map((p) => {names})")


def test_the_help_lists_every_key_that_does_something(tmp_path, recording):
    with served(str(recording)) as (address, _), page_of(address, tmp_path) as page:
        page.value("window.rangerPanel.plots.setMark(1)")
        Hand(page).give("#note", "a step")
        Hand(page).click("#note-form button", "Keep")
        for place, keys in page.value("window.rangerPanel.keys()").items():
            assert keys["listed"] == keys["bound"], place
        Hand(page).view("help")
        shown = page.value("[...document.querySelectorAll('#keys dt')].map((e) => e.textContent.trim())")
        assert {"h", "/", "← →", "+ -", "m", "n", "1 … 9", "Space", "Esc", "Alt+0 … Alt+5", "Del Backspace"} <= {*shown}


def test_channels_go_from_plot_to_plot_and_out_again_by_keys_alone(tmp_path, recording):
    with served(str(recording)) as (address, _), page_of(address, tmp_path) as page:
        before = plots(page)
        assert before[0] == ["hip_rad", "ankle_outer_rad", "ankle_inner_rad"]
        press(page, "1")  # the plot into which channels go
        press(page, "/")
        for sign in "steering_A":
            press(page, sign)
        press(page, "ArrowDown")
        press(page, "Enter")
        assert plots(page)[0] == [*before[0], "steering_A"]
        assert focus(page) == "steering_A A"  # the list has not been made anew under the finger
        page.value("document.querySelector('.chip[data-channel]').focus()")
        press(page, "ArrowDown")  # hip_rad goes into the second plot, and the focus with it
        assert plots(page)[:2] == [["ankle_outer_rad", "ankle_inner_rad", "steering_A"], [*before[1], "hip_rad"]]
        assert focus(page) == "hip_rad, rad: take it out of plot 2"
        press(page, "Delete")
        assert plots(page)[1] == before[1]
        assert page.value("document.activeElement.closest('.plot') !== null")


def test_cursor_window_mark_and_notes_are_moved_by_keys_and_their_values_are_announced(tmp_path, recording):
    with served(str(recording)) as (address, _), page_of(address, tmp_path) as page:
        press(page, "ArrowRight", SHIFT)
        press(page, "ArrowRight")
        page.until("document.getElementById('clock').textContent === '0.110 s'")
        page.until("document.getElementById('said').textContent.startsWith('0.110 s. hip_rad, rad: ')")
        wide = page.value("window.rangerPanel.held()")
        press(page, "+")
        near = page.value("window.rangerPanel.held()")
        assert near[1] - near[0] == pytest.approx((wide[1] - wide[0]) / 2)
        assert near[0] <= 0.11 <= near[1]
        press(page, "-")
        assert page.value("window.rangerPanel.held()") == wide
        press(page, "m")
        assert page.value("window.rangerPanel.plots.mark()") == pytest.approx(0.11)
        press(page, "n")
        for sign in "hm1":  # in a field keys are letters
            press(page, sign)
        press(page, "Enter")
        assert page.value("document.querySelector('#notes button').textContent") == "0.110 s: hm1"
        page.value("document.querySelector('#notes button').focus()")
        press(page, "Delete")
        assert page.value("document.querySelectorAll('#notes button').length") == 0
        press(page, "Escape")  # in the note's field, which has the focus now: it is left alone
        assert page.value("document.activeElement.id") == "note"


def test_tab_comes_through_every_view_and_back_and_what_has_the_focus_is_seen(tmp_path, recording):
    with served(str(recording)) as (address, _), page_of(address, tmp_path) as page:
        page.value("document.querySelector('[data-view=plots]').focus()")
        press(page, "End")
        assert page.value("location.hash").startswith("#view=help")
        press(page, "Home")
        assert page.value("location.hash").startswith("#view=plots")
        seen = []
        for _ in range(80):
            press(page, "Tab")
            ring = "getComputedStyle(document.activeElement.closest('.file') ?? document.activeElement).outlineStyle"
            name = focus(page)
            if page.value("document.activeElement === document.body") or name in seen[:1]:
                break
            assert page.value(ring) != "none", name
            seen.append(name)
        assert len(seen) < 80, "a trap, or a tab stop for every channel"
        assert {"Go to the view", "Add a plot", "Save CSV", "search channels", "close plot 1"} <= {*seen}
