"""Pages with plots: one small file, the same bytes every time, every figure drawn in a real browser."""

import json
import re

import plotly.graph_objects as go
import pytest

from ranger_sim.tools.cli import main
from ranger_sim.tools.report import figures
from tests import browser


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    """The page of `identify all`, written twice."""
    made = [tmp_path_factory.mktemp("identified") for _ in range(2)]
    for folder in made:
        assert main(["identify", "all", "--out", str(folder)]) == 0
    return [folder / "identify.html" for folder in made]


def test_a_page_has_the_same_bytes_every_time_and_is_under_three_megabytes(identified):
    first, second = (page.read_bytes() for page in identified)
    assert first == second
    assert len(first) < 3_000_000


@pytest.mark.skipif(browser.BROWSER is None, reason="no chromium on this machine")
@pytest.mark.parametrize("width", [390, 768, 1400])
def test_every_figure_is_drawn_within_the_width_of_the_window(identified, tmp_path, width):
    figures_there = identified[0].read_text().count('class="figure"')
    assert figures_there == 6  # stall, torque constant, friction, swings, two springs
    with browser.opened(tmp_path) as page:
        page.open(identified[0], width)
        page.until("document.documentElement?.dataset.plots === 'drawn'")
        assert page.value("document.querySelectorAll('.js-plotly-plot .main-svg').length") >= figures_there
        assert page.value("document.querySelectorAll('.js-plotly-plot').length") == figures_there
        assert page.value("document.documentElement.scrollWidth") <= width
        assert page.value("document.getElementById('no-plots').hidden")
        assert page.errors == []


def test_the_text_of_a_figure_cannot_end_its_script_or_become_markup():
    figure = go.Figure(go.Scatter(x=[0.0, 1.0], y=[0.5, 2.5], name="</script><b>bold</b>"))
    html = str(figures.placed(figure))
    (numbers,) = re.findall(r'<script type="application/json" class="figure">(.*?)</script>', html)
    assert html.count("<") == 4 and json.loads(numbers)["data"][0]["name"] == "</script><b>bold</b>"
    assert json.loads(numbers)["data"][0]["y"] == [0.5, 2.5]
