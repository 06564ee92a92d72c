"""The page for who has it read aloud: axe-core finds nothing in any view, and what has a picture has words."""

import importlib.resources
import itertools
import os
import re
import signal
import subprocess
import sys

import pytest

from tests import browser
from tests.tools.panel.test_page import PATIENCE_S, Hand, page_of, served

pytestmark = pytest.mark.skipif(browser.BROWSER is None, reason="no browser here")
AXE = importlib.resources.files("axe_playwright_python").joinpath("axe.min.js")
# What axe finds, of whatever weight: the rule, and where.
FOUND = """axe.run(document, { resultTypes: ["violations"] }).then((all) => all.violations.map(
    (each) => `${each.impact}: ${each.id}: ${each.nodes.map((node) => node.html.slice(0, 120)).join(" ")}`))"""
# Roles that say nothing without a name.
NAMED = {"button", "checkbox", "combobox", "img", "link", "meter", "searchbox", "slider", "tab", "table", "textbox"}


def looked_through(page, views):
    """Every view, light and dark, at a telephone's width and at a screen's."""
    hand = Hand(page)
    page.value(AXE.read_text(encoding="utf-8") + ";0")
    for dark in (False, True):
        page.colours(dark)
        for width in (390, 1400):
            page.resize(width, 1000, 1)
            for view in views:
                hand.view(view)
                pictures = page.value("window.rangerPanel.shown()")
                page.until(f"window.rangerPanel.shown() > {pictures} + 2")
                assert page.value(FOUND) == [], (view, width, "dark" if dark else "light")


def named(page):
    """{role: names} of what the browser reports to a screen reader."""
    found = {}
    for node in page.call("Accessibility.getFullAXTree")["nodes"]:
        if not node.get("ignored"):
            name = node.get("name", {}).get("value", "")
            found.setdefault(node["role"]["value"], []).append(name)
    return found


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The page of a robot that walks."""
    with served("--walk") as (address, _), page_of(address, tmp_path_factory.mktemp("walking")) as page:
        yield page


def test_what_is_live_speaks_only_when_it_has_something_new(page):
    page.until("window.rangerPanel.span()[1] > 2")
    page.value("""{
        window.spoken = [];
        const heard = new MutationObserver((all) => spoken.push(...all.map((each) => each.target.textContent)));
        for (const each of document.querySelectorAll("[role=status], [role=alert], [aria-live]"))
            heard.observe(each, { childList: true, characterData: true, subtree: true });
        0 }""")
    pictures = page.value("window.rangerPanel.shown()")
    page.until(f"window.rangerPanel.shown() > {pictures} + 40")
    # A robot that has no processor for a second is news, and so is its return; neither is said twice.
    pauses = {"no message from the panel's server", "no new values from the robot", "no unexpected error"}
    spoken = page.value("window.spoken")
    assert {*spoken} <= pauses, spoken
    assert all(text != before for before, text in itertools.pairwise(spoken)), spoken


def test_axe_finds_nothing_in_any_view_of_a_robot_and_everything_has_a_name(page):
    page.until("window.rangerPanel.span()[1] > 2")
    page.value("document.getElementById('pause').click()")  # it need not keep its pace beside this
    Hand(page).sees("state.pace.paused === true")
    looked_through(page, ["plots", "parameters", "errors", "inside", "faults", "twins", "help"])
    for view in ("plots", "inside"):
        Hand(page).view(view)
        reported = named(page)
        for role in NAMED & reported.keys():
            assert all(name.strip() for name in reported[role]), (view, role, reported[role])
        assert any(re.match(r"light 1: \w+", name) for name in reported["image"] if "light" in name), reported["image"]
        assert any(name.startswith("display: ") for name in reported["image"])
        if view == "plots":
            plot = r"plot 1, -?\d+\.\d to \d+\.\d s\. hip_rad, rad: -?0\.\d+, between -?\d.* and \d"
            assert any(re.match(plot, name) for name in reported["image"])
        else:
            assert {"slots of the boards", "loads of the buses", "newest frames"} <= {*reported["table"]}


def test_axe_finds_nothing_in_the_view_of_a_data_link_and_plots_have_no_line_in_its_gaps(tmp_path):
    command = [sys.executable, "-m", "ranger_sim", "up", "--daq-port", "pty", "--daq-dropouts"]
    command += ["--name", f"linked-{os.getpid()}"]
    robot = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        port = next(found[0] for line in robot.stderr if (found := re.search(r"/dev/pts/\d+", line)))
        with served("--port", port) as (address, _), page_of(address, tmp_path) as page:
            hand = Hand(page)
            hand.view("link")
            hand.sees("state.link?.lists?.some((row) => row.list === 'fast' && row.variables > 3 && row.rate_hz > 10)")
            looked_through(page, ["link"])
            # one of the last 4 s, which a window of 10 s still has when it is held
            newest = "state.link.chosen.find((row) => row.name === 'MCH_ANGLE')?.last_s"
            hand.sees(f"({newest} ?? -Infinity) > state.time_s - 4")
            rows = "[...document.querySelectorAll('#link-chosen tbody tr')].map((row) => row.innerText.split(/[\\s]+/))"
            reported = next(row for row in page.value(rows) if row[0] == "MCH_ANGLE")
            last_s = float(reported[-2])  # when it came again, and "s"
            hand.view("plots")
            hand.click("#freeze", "Hold")
            plot = "window.rangerPanel.plots.all()[0]"
            page.until(f"{plot}.strip === null && {plot}.found?.length > 0")
            assert page.value("document.querySelector('.chip span').textContent").startswith("MCH_ANGLE")
            times, low = page.value(f"[{plot}.found[0].x, {plot}.found[0].low].map((each) => Array.from(each))")
            begin, end = page.value("window.rangerPanel.held()")
            column_s = (end - begin) / page.value(f"window.rangerPanel.plots.points({plot}, false)")
            nothing = [k for k, value in enumerate(low) if value is None and 0 < k < len(low) - 1]
            assert nothing
            # a point has the time when it was measured, the list tells when it came: some cycles of 2 ms later
            assert min(abs(times[k + 1] - last_s) for k in nothing) <= column_s + 0.01
            # silences of the radio last 50 to 180 ms, and columns reach into them from both ends
            assert all(times[k + 1] - times[k - 1] > 0.05 - 2 * column_s for k in nothing)
    finally:
        robot.send_signal(signal.SIGINT)
        robot.communicate(timeout=PATIENCE_S)
