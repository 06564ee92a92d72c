"""The page in a real browser, on a robot that walks meanwhile."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import control
from tests import browser

pytestmark = pytest.mark.skipif(browser.BROWSER is None, reason="no browser here")
PATIENCE_S = 120


@contextlib.contextmanager
def served(*arguments):
    """(address of a panel, its process)."""
    command = [sys.executable, "-m", "ranger_sim", "panel", *arguments, "--http-port", "0"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        for line in process.stderr:
            if found := re.search(r"http://\S+", line):
                break
        else:
            raise AssertionError("the panel ended without an address")
        yield found[0], process
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE_S)


@contextlib.contextmanager
def page_of(address, folder, width=1400):
    with browser.opened(folder / "browser") as page:
        page.open(address, width, 1000, 1)
        page.until("document.body?.dataset.connected === 'yes' && window.rangerPanel?.shown() > 0")
        yield page
        assert not page.errors


class Hand:
    """What a person does on the page."""

    def __init__(self, page):
        self.page = page

    def click(self, css, text=""):
        """The first element of these whose words begin so."""
        found = f"[...document.querySelectorAll({json.dumps(css)})].find((e) => e.textContent.startsWith('{text}'))"
        self.page.until(f"{found} !== undefined")
        self.page.value(f"{found}.click()")

    def view(self, name):
        """Another tab."""
        self.click(f"[data-view={name}]")

    def give(self, css, value):
        """Another value for a field or a list."""
        element = f"document.querySelector({json.dumps(css)})"
        self.page.value(f"{{ const e = {element}; e.value = '{value}'; e.oninput?.(); e.onchange?.(); 0 }}")

    def sees(self, condition):
        """Wait for what the page shows; `state` is the robot's, `text(id)` what an element says."""
        self.page.until(
            "((state, text) => "
            + condition
            + ")(window.rangerPanel.state(), (id) => document.getElementById(id).textContent)"
        )


def robot_name(page):
    return page.value("document.getElementById('title').textContent").partition(":")[0]


def test_a_person_at_the_panel_of_a_walking_robot(tmp_path):
    with served("--walk") as (address, _), page_of(address, tmp_path) as page:
        hand = Hand(page)
        # it walks, and the plots go on with it
        page.until("window.rangerPanel.span()[1] > 2.5")
        pictures = page.value("window.rangerPanel.shown()")
        page.until(f"window.rangerPanel.shown() > {pictures} + 10")
        # a channel is found by its words and drawn
        hand.give("#search", "legs absolute encoder")
        hand.click("#add-plot")
        hand.click("#channels button", "MCH_ANGLE")
        page.until("window.rangerPanel.plots.all().at(-1).drawn > 2")
        # the lines have the height that the axis has
        high = "((p) => [p.strip.canvas.height, Math.round(p.chart.bbox.height)])(window.rangerPanel.plots.all()[0])"
        assert len(set(page.value(high))) == 1
        drawn = page.value("window.rangerPanel.plots.all().at(-1).found[0].low.at(-1)")
        assert -0.6 < drawn < 0.6  # rad between the legs of a walking robot
        assert "MCH_ANGLE" in page.value("location.hash")
        # a parameter is changed and the robot has it; beyond its limits it is refused
        hand.view("parameters")
        field = "[aria-label=P_UI_LCD_TIME]"
        page.until(f"document.querySelector('{field}')?.value > 0")
        hand.give(field, 700)
        page.until(f"document.querySelector('{field}').closest('tr').classList.contains('changed')")
        hand.give(field, 5)
        hand.sees("text('parameter-note').includes('outside 100 to 60000')")
        # a fault is armed, acts and is cleared
        hand.view("faults")
        hand.give("#fault-place", "MCH.joint_encoder")
        hand.give("#fault-mode", "offset")
        hand.click("#fault-form button", "Arm")
        hand.sees("state.faults?.[0]?.acted === true")
        hand.click("#fault-list button", "Clear")
        hand.sees("state.faults[0].ended_s !== null")
        # slots and frames
        hand.view("inside")
        page.until("document.querySelectorAll('#boards tr').length === 8")
        page.until("document.querySelectorAll('#frames tr').length > 5")
        # a key of the panel is the robot's key: the controller stops and the robot falls
        hand.click(".keys button", "key 2")
        hand.sees("state.ended !== ''")
        page.until("document.getElementById('light').className !== 'light good'")


def test_the_page_comes_back_when_the_connection_was_lost_and_the_robot_ends_with_its_panel(tmp_path):
    with served("--walk") as (address, process), page_of(address, tmp_path) as page:
        name = robot_name(page)
        page.until("window.rangerPanel.span()[1] > 0.5")
        page.call("Network.enable")
        link = {"latency": 0, "downloadThroughput": -1, "uploadThroughput": -1}
        page.call("Network.emulateNetworkConditions", offline=True, **link)
        assert control.ask(name, {"do": "status"})["name"] == name  # the robot does not mind
        page.call("Network.emulateNetworkConditions", offline=False, **link)
        pictures = page.value("window.rangerPanel.shown()")
        page.until(f"window.rangerPanel.shown() > {pictures} + 5")
        process.send_signal(signal.SIGTERM)
        process.wait(timeout=PATIENCE_S)
        page.until("document.body.dataset.connected === 'no'")
        with pytest.raises(UserError, match="no robot named"):
            control.ask(name, {"do": "status"})
        page.errors.clear()  # the browser tells of the refused connections


def test_values_of_a_server_or_a_robot_that_stopped_are_shown_with_their_age(tmp_path):
    with served("--walk") as (address, process), page_of(address, tmp_path) as page:
        hand = Hand(page)
        page.until("window.rangerPanel.span()[1] > 0.5")
        hand.sees("text('age') === '' && document.getElementById('light').className === 'light good'")
        process.send_signal(signal.SIGSTOP)
        try:
            hand.sees("text('light-text').startsWith('no message from the panel') && /^[2-9] s old$/.test(text('age'))")
            assert page.value("document.getElementById('light').className") == "light off"
            assert page.value("getComputedStyle(document.getElementById('clock')).textDecorationLine") == "line-through"
        finally:
            process.send_signal(signal.SIGCONT)
        hand.sees("text('age') === '' && text('light-text') === 'no unexpected error'")
        plant = control.ask(robot_name(page), {"do": "status"})["plant"]
        os.kill(plant, signal.SIGSTOP)
        try:
            hand.sees("text('light-text') === 'no new values from the robot' && /^[2-9] s old$/.test(text('age'))")
        finally:
            os.kill(plant, signal.SIGCONT)
        hand.sees("text('age') === ''")
        control.ask(robot_name(page), {"do": "pause"})
        hand.sees("state.pace.paused === true")
        hand.sees("text('age') === ''")


def test_on_a_telephone_no_view_is_wider_than_the_window_and_no_row_is_torn_into_many_lines(tmp_path):
    with served("--walk") as (address, _), page_of(address, tmp_path, 390) as page:
        hand = Hand(page)
        hand.view("faults")
        hand.give("#fault-place", "MCH.joint_encoder")
        hand.give("#fault-mode", "stuck")
        hand.give("#fault-end", "+4 ms")
        hand.click("#fault-form button", "Arm")
        hand.sees("state.faults?.[0]?.cleared_s")
        for view in page.value(
            "[...document.querySelectorAll('nav [data-view]:not([hidden])')].map((e) => e.dataset.view)"
        ):
            hand.view(view)
            page.value("for (const each of document.querySelectorAll('details')) each.open = true")
            pictures = page.value("window.rangerPanel.shown()")
            page.until(f"window.rangerPanel.shown() > {pictures} + 3")
            assert page.value("document.documentElement.scrollWidth <= innerWidth"), view
            # three lines of a table's 13 px at the browser's line height, with its borders
            rows = "[...document.querySelectorAll('tr')].filter((e) => e.offsetHeight > 75).map((e) => e.textContent)"
            assert page.value(rows) == [], view
