"""A campaign's page: what it says of a run, in the words of the machine, within the width of the window."""

import re
import subprocess
import sys

import pytest

from ranger_sim.tools import cli
from ranger_sim.tools.campaign.page import setting_columns, setting_rows, why_text
from tests import browser
from tests.firmware_sim.native.support import COMPILER


def test_a_fall_is_reported_with_its_time_and_not_mixed_up_with_another_outcomes_reason():
    assert why_text({"outcome": "fall", "why": "fell forward", "fall_ms": 722.4}) == "fell forward after 722 ms"
    damaged = {"outcome": "damage", "why": "hip motor beyond 6 A for 14 ms", "fall_ms": 1990.0}
    assert why_text(damaged) == "hip motor beyond 6 A for 14 ms; fell after 1990 ms"
    assert why_text({"outcome": "undetected wrong", "why": "step time +20 %", "fall_ms": None}) == "step time +20 %"


def test_a_sweeps_table_has_the_quantities_of_the_machine_at_hand():
    slot = {"board": "HIP", "margin": 0.25, "overruns": 3}
    walk = {"outcome": "masked", "why": "", "gait": {"steps": 10, "step_length_m": 0.3456}, "slot": slot}
    fallen = {"outcome": "fall", "why": "fell forward", "gait": {"steps": 0}, "slot": slot | {"margin": None}}
    assert setting_columns([walk, fallen]) == [
        "outcome", "why", "steps", "step length, m", "least slot margin", "overruns"
    ]  # fmt: skip
    assert [cells for _, cells in setting_rows([walk, fallen])] == [
        ["masked", "", "10", "0.346", "25.0 % (HIP)", "3"],
        ["fall", "fell forward", "0", "", "", "3"],
    ]
    wheel = {"outcome": "masked", "why": "", "gait": {"rate_rad_per_s_off": 0.5}, "slot": slot}
    assert "rate rad per s off" in setting_columns([wheel])


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The page of a campaign of a machine that `ranger-sim new` writes: a wheel."""
    if not COMPILER:
        pytest.skip("no C compiler is installed here")
    folder = tmp_path_factory.mktemp("campaign")
    assert cli.main(["new", str(folder / "wheel")]) == 0
    plan = str(folder / "wheel" / "campaign.toml")  # its modules have common names: they get a process
    command = [sys.executable, "-m", "ranger_sim", "campaign", plan, "--pool", "local", "--out", str(folder / "out")]
    subprocess.run(command, check=True, capture_output=True)
    return folder / "out" / "index.html"


def test_a_machine_that_does_not_walk_is_not_described_as_a_robot_that_does(page):
    text = re.sub(r"<(script|style).*?</\1>", " ", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert "the machine could go no further" in text and "WHEEL.encoder" in text
    assert not [word for word in ("robot", "gait", "walk", "detected before the fall") if word in text.lower()]


@pytest.mark.skipif(browser.BROWSER is None, reason="no chromium on this machine")
def test_nothing_is_wider_than_the_window(page, tmp_path):
    with browser.opened(tmp_path) as window:
        for width in (390, 768, 1400):
            window.open(page, width)
            window.until("document.documentElement?.dataset.plots === 'drawn'")
            assert window.value("document.documentElement.scrollWidth") <= width
            clipped = "[...document.querySelectorAll('.js-plotly-plot')].filter(e => e.clientWidth < 280).length"
            assert window.value(clipped) == 0
            assert window.errors == []
        tables = "[...document.querySelectorAll('section')].filter(e => e.scrollWidth > e.clientWidth).length"
        assert window.value(tables) == 0  # nothing needs to be scrolled on a wide window
