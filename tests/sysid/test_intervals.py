"""Intervals by the profile: a shape that is not known widens the interval of the size that goes with it."""

import numpy as np
import pytest
from scipy import stats

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.intervals import profile, sign_is_known, whole
from ranger_sim.sysid.machine import Effect, Equation, Recording
from ranger_sim.sysid.naming import refit, select
from ranger_sim.sysid.regression import Regression

SIZE = 1500
WIDTHS = (0.25, 0.5, 1.0, 2.0, 4.0)
TRUE_HEIGHT, TRUE_WIDTH = 0.25, 0.7  # between two widths of the grid


def bump(recording, shape, _):
    return {"force": np.exp(-((recording.signals["x"] / shape["width"]) ** 2))[:, None]}


def effect(scale):
    return Effect("bump", "here", "mechanical", ("height",), [{"width": each} for each in WIDTHS], bump, scale=scale)


def regression(seed):
    rng = generator(seed, "bump")
    x = rng.uniform(-4.0, 4.0, SIZE)
    force = 0.3 + 0.5 * x + TRUE_HEIGHT * np.exp(-((x / TRUE_WIDTH) ** 2)) + 0.1 * rng.normal(size=SIZE)
    columns = {"slope": x, "level": np.ones(SIZE)}
    made = Equation("force", "M", "mechanical", "N", force, columns, np.ones(SIZE, dtype=bool))
    table = Table(np.arange(SIZE) * 1e-3, {}, (slice(0, SIZE),), "made")
    return Regression([Recording(table, {"x": x}, {"force": made})])


def found(seed, scale):
    made = regression(seed)
    (named,) = select([effect(scale)], made)
    return profile(named, made)


def test_a_shape_on_a_scale_is_found_between_the_values_of_its_grid():
    shape, _ = found(1, "width")
    assert shape["width"] not in WIDTHS
    assert shape["width"] == pytest.approx(TRUE_WIDTH, rel=0.35)


def test_a_shape_on_no_scale_keeps_to_its_grid():
    shape, _ = found(1, None)
    assert shape["width"] in WIDTHS


def test_intervals_of_size_and_shape_hold():
    """Of 100 each as many as 100 tosses of a 95 % coin allow, one time in 10^4 apart; few are too wide to decide."""
    held = {"height": 0, "width": 0}
    lengths = []
    for seed in range(100):
        _, intervals = found(seed, "width")
        for name, truth in (("height", TRUE_HEIGHT), ("width", TRUE_WIDTH)):
            low, high = intervals[name]
            held[name] += low <= truth <= high
        lengths.append(intervals["height"][1] - intervals["height"][0])
    least = stats.binom.ppf(1e-4, 100, 0.95)
    assert held["height"] >= least
    assert held["width"] >= least
    assert np.median(lengths) < 0.6 * TRUE_HEIGHT


def test_at_the_best_shape_alone_the_interval_would_be_too_short():
    _, intervals = found(3, "width")
    made = regression(3)
    column = made.columns([bump(made.recordings[0], {"width": TRUE_WIDTH}, {})])
    alone = 2.0 * 1.96 / float(np.linalg.norm(column))
    assert intervals["height"][1] - intervals["height"][0] > 1.05 * alone


@pytest.mark.parametrize(
    ("ends", "known"),
    [
        ({"height": (0.1, 0.4), "width": (-1.0, 2.0)}, True),  # a shape has no sign to know
        ({"height": (-0.4, -0.1), "width": (0.5, 2.0)}, True),
        ({"height": (-0.1, 0.4), "width": (0.5, 2.0)}, False),
        ({"height": (0.0, 0.4), "width": (0.5, 2.0)}, False),
    ],
)
def test_the_sign_of_a_size_is_known_where_its_interval_has_no_zero(ends, known):
    (named,) = select([effect("width")], regression(1))
    assert sign_is_known(named, ends) == known


def test_the_whole_interval_is_its_profile_and_the_regressions_error():
    made = regression(2)
    (named,) = select([effect("width")], made)
    extended = refit(made, [named])
    number = extended.names.index(*named.coefficients)
    value, error = extended.values[named.coefficients[0]], float(np.sqrt(extended.covariance[number, number]))
    near, far = (value - 0.1 * error, value + 0.1 * error), (value - 9.0 * error, value + error)
    assert whole(named, extended, {"height": near, "width": (0.5, 0.9)}) == {
        "height": pytest.approx((value - 1.96 * error, value + 1.96 * error)),
        "width": (min(0.5, named.shape["width"]), max(0.9, named.shape["width"])),
    }
    assert whole(named, extended, {"height": far})["height"] == pytest.approx((far[0], value + 1.96 * error))
