"""The page of a diagnosis: it says what the answer says, draws where the cause shows, and needs no other file."""

import re

import numpy as np
import pytest

from ranger_sim.sysid import answer
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.sysid.regression import reduced
from ranger_sim.tools.diagnose import figures, page, words
from ranger_sim.tools.report.figures import library
from tests import browser
from tests.sysid.test_diagnose import Cart, cart_run


@pytest.fixture(scope="module")
def found():
    """Of a cart with drag, on one run, held against another."""
    return diagnose(Cart(), [cart_run(1, drag=0.02)], [cart_run(2, drag=0.02)])


@pytest.fixture(scope="module")
def drawn(found):
    return page.render(found, "ranger-sim diagnose a.csv", {"diagnosis.json": "the answer"})


def text_of(html):
    """What a reader sees: no scripts, no styles, no tags."""
    html = html.replace("<wbr>", "")
    html = re.sub(r"<(script|style).*?</\1>", " ", html, flags=re.DOTALL)
    return " ".join(re.sub(r"<[^>]+>", " ", html).split())


def test_the_page_says_what_is_wrong_how_large_how_sure_and_where_to_look(found, drawn):
    said = text_of(drawn)
    assert said.count("One cause found") == 2  # title and heading
    assert "Air or oil resists with the square of the rate: drag at cart." in said
    value = found.answer["causes"][0]["parameters"]["quadratic"]
    assert f"{value['value']:.4g} {value['ci95'][0]:.4g} to {value['ci95'][1]:.4g}" in said
    assert "a flapping harness" in said  # inspection.LOOK_AT["drag"]
    share = found.answer["gain"]["fraction_of_achievable"]
    assert f"{100 * share:.0f} % of what can be achieved on run 2" in said
    assert "floor at rail" in said and "behind" in said
    assert "not physical" not in said
    assert "ranger-sim diagnose a.csv" in said


def test_the_page_is_one_file_and_the_same_each_time(found, drawn):
    without_library = drawn.replace(str(library()), "")
    assert not re.search(r"""(src|href)=["'](https?:)?//""", without_library)
    again = page.render(found, "ranger-sim diagnose a.csv", {"diagnosis.json": "the answer"})
    assert again == drawn


def test_a_cause_is_drawn_where_it_shows_and_the_model_with_it_leaves_nothing_there(found):
    """F = 0.02 v |v|: over the speed its part outside the base is largest at the ends; with it the means are noise."""
    made = figures.sides(found)
    (each,) = found.named
    side = made["force"]
    signature = figures.beside(found, each, "force")[side.rows]
    over = figures.candidates(found, side)
    assert max(over, key=lambda name: figures.explained(over[name], signature)) == "v"
    # by the truth: what of v |v| straight lines in v and a leave
    v, a = (found.recordings[0].signals[name] for name in ("v", "a"))
    base, drag = (
        reduced(found.recordings[0], each, "force") for each in (np.column_stack([v, a]), 0.02 * v * np.abs(v))
    )
    truth = (drag - base @ np.linalg.lstsq(base, drag, rcond=None)[0])[side.rows]
    assert np.corrcoef(signature, truth)[0, 1] > 0.999
    # the coefficient is known to some percent
    assert np.std(signature) == pytest.approx(np.std(truth), rel=0.2)
    figure = figures.of_cause(found, each, made)
    assert figure.title == "Where drag shows" and "v" in figure.html


def test_both_models_are_drawn_against_the_measurement(found):
    side = figures.sides(found)["force"]
    run = found.recordings[0].table
    np.testing.assert_allclose(side.measured, reduced(found.recordings[0], run["force_N"], "force")[side.rows])
    after, before = (np.std(side.measured - each) for each in (side.after, side.before))
    # noise of 0.05 N is what the right model leaves, under the band's Gaussian
    under = max(1.0, 2.0 * found.recordings[0].width * np.sqrt(np.pi))
    assert after == pytest.approx(0.05 / np.sqrt(under), rel=0.1)
    (each,) = found.named
    signature = figures.beside(found, each, "force")[side.rows]
    assert before**2 == pytest.approx(after**2 + np.var(signature), rel=0.01)
    assert figures.gap(side) > 0.01


def test_nothing_found_is_reported():
    found = diagnose(Cart(), [cart_run(1)])
    said = text_of(page.render(found))
    assert said.count("Nothing found") == 2
    assert "Nothing that these data could show is missing from the equations." in said
    assert "Look at on the machine" not in said and "How sure" not in said


def test_an_unknown_fault_is_drawn_where_the_general_tests_see_it_and_its_parameters_are_marked():
    found = diagnose(Cart(), [cart_run(1, magnet=0.15)])
    said = text_of(page.render(found))
    assert said.count("Something is wrong, and it is not known what") == 2
    assert "no cause of the catalogue explains it" in said
    assert "Where the force equation is off" in said
    assert "not physical" in said
    assert "The same run once more" in said


def test_a_tie_names_both_and_shows_where_to_look_for_each():
    found = diagnose(Cart(), [cart_run(1, slope=0.02)])
    said = text_of(page.render(found))
    assert "these data cannot decide" in said
    assert "A spirit level along the path" in said and "power-up" in said
    assert "a tie" in said


def test_names_from_a_file_are_text_and_no_markup():
    run = cart_run(1)
    odd = Table(run.time_s, run.columns, run.runs, "<script>alert(1)</script>.csv")
    html = page.render(diagnose(Cart(), [odd]))
    assert "<script>alert(1)" not in html and "&lt;script&gt;alert(1)" in html


def test_cosine_and_sine_are_reported_as_an_amplitude_and_a_phase():
    """3 cos x + 4 sin x has amplitude 5; its deviation is along that direction: sqrt((9 * 0.01 + 16 * 0.04) / 25), that
    of the phase across it: sqrt((16 * 0.01 + 9 * 0.04) / 25) / 5."""

    class Extended:
        names = ("a:cosine", "a:sine")
        values = {"a:cosine": 3.0, "a:sine": 4.0}
        covariance = np.diag([0.01, 0.04])

    class Each:
        coefficients = ("a:cosine", "a:sine")

        class effect:  # noqa: N801
            coefficients = ("cosine_Nm", "sine_Nm")

    found = answer.waves(Extended, Each)
    size, phase = found["amplitude_Nm"], found["phase_rad"]
    assert size.value == 5.0 and phase.value == pytest.approx(np.arctan2(4.0, 3.0))
    assert size.ci95[1] - 5.0 == pytest.approx(1.96 * np.sqrt((9 * 0.01 + 16 * 0.04) / 25))
    assert phase.ci95[1] - phase.value == pytest.approx(1.96 * np.sqrt((16 * 0.01 + 9 * 0.04) / 25) / 5.0)


def test_a_first_line_has_the_amplitude_and_the_shape_and_no_cosine():
    values = {"value": 1.0, "ci95": [0.9, 1.1]}
    cause = {
        "parameters": {"cosine_Nm": values, "sine_Nm": values, "periods": values},
        "waves": {"amplitude_Nm": values},
    }
    assert list(words.sizes(cause)) == ["amplitude_Nm", "periods"]
    assert list(words.sizes({"parameters": {"lag_s": values}})) == ["lag_s"]


def test_a_rival_is_a_tie_only_when_it_could_be():
    assert words.standing(3.0) == "as near, with a value that no machine has"
    assert words.standing(8.0) == "close" and words.standing(30.0) == "behind"


@pytest.mark.skipif(browser.BROWSER is None, reason="no chromium on this machine")
def test_nothing_is_wider_than_the_window(drawn, tmp_path):
    (tmp_path / "report.html").write_text(drawn, encoding="utf-8")
    with browser.opened(tmp_path / "profile") as window:
        for width in (390, 768, 1400):
            window.open(tmp_path / "report.html", width)
            window.until("document.documentElement?.dataset.plots === 'drawn'")
            assert window.value("document.documentElement.scrollWidth") <= width
            assert window.errors == []
        clipped = "[...document.querySelectorAll('.wide')].filter(e => e.scrollWidth > e.clientWidth).length"
        assert window.value(clipped) == 0  # nothing needs to be scrolled on a wide window
