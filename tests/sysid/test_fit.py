"""Fits: known answers, intervals that hold at their rate, and what is refused."""

import numpy as np
import pytest
from scipy import stats

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.fit import (
    Parameter,
    fit,
    identifiability,
    independent_samples,
    neighbours_correlation,
    signature_cosines,
)

SLOPE = Parameter("slope", "V/A", 1.0, -10.0, 10.0)
INTERCEPT = Parameter("intercept", "V", 0.5, -10.0, 10.0)


def line(x, y):
    return lambda values: y - values["slope"] * x - values["intercept"]


def noisy_line(seed=1, count=50, sigma=0.1):
    x = np.linspace(-1.0, 3.0, count)
    return x, 1.3 * x + 0.7 + sigma * generator(seed, "line").standard_normal(count)


def autocorrelated(random, count, rho):
    """AR(1) of unit variance: each value rho of the one before and news of sqrt(1 - rho^2)."""
    news = random.standard_normal(count)
    made = np.empty(count)
    made[0] = news[0]
    for at in range(1, count):
        made[at] = rho * made[at - 1] + np.sqrt(1.0 - rho * rho) * news[at]
    return made


def test_a_straight_line_has_the_textbook_s_values_errors_and_interval():
    x, y = noisy_line()
    found = fit(line(x, y), [SLOPE, INTERCEPT], effective_samples=len(x))
    textbook = stats.linregress(x, y)
    # central differences of a linear residual are exact to rounding over the step, 1e-16 / 1e-5
    assert found["slope"] == pytest.approx(textbook.slope, rel=1e-9)
    assert found["intercept"] == pytest.approx(textbook.intercept, rel=1e-9)
    assert found.standard_errors["slope"] == pytest.approx(textbook.stderr, rel=1e-8)
    assert found.standard_errors["intercept"] == pytest.approx(textbook.intercept_stderr, rel=1e-8)
    half = stats.t.ppf(0.975, len(x) - 2) * textbook.stderr
    assert found.ci95["slope"] == pytest.approx((textbook.slope - half, textbook.slope + half), rel=1e-8)


def test_the_estimates_correlation_is_the_signatures_cosine():
    # Two derivations: of a least-squares fit, cov = (J^T J)^-1; its partial form is the angle of what is left of two
    # columns when all others are projected out, with the sign turned.
    random = generator(2, "columns")
    columns = random.standard_normal((40, 3)) + random.standard_normal((40, 1))
    y = columns @ [1.0, 2.0, 3.0] + random.standard_normal(40)
    parameters = [Parameter(name, "1", 1.0) for name in "abc"]
    found = fit(lambda v: y - columns @ np.array([v["a"], v["b"], v["c"]]), parameters, effective_samples=40)
    assert np.abs(found.correlations) == pytest.approx(signature_cosines(columns), abs=1e-7)
    assert found.correlations[0, 1] < 0.0


def test_a_parameter_that_moves_nothing_is_named_before_the_fit():
    x, y = noisy_line()
    ghosts = [Parameter("ghost", "1", 1.0), Parameter("spook", "1", 0.0, -1.0, 1.0)]
    with pytest.raises(UserError, match="parameter ghost, spook: a change of it does not move the residual"):
        fit(line(x, y), [SLOPE, *ghosts, INTERCEPT])


def test_a_parameter_in_a_dead_zone_at_the_start_is_not_called_dead():
    x, y = noisy_line()

    def residual(values):
        return y - 1.3 * x - max(values["threshold"], 1.02)

    assert identifiability(residual, [Parameter("threshold", "1", 1.0)]).names == ("threshold",)


def test_two_parameters_with_the_same_effect_are_reported_before_and_refused_after_the_fit():
    x, y = noisy_line()
    told = []
    twins = [SLOPE, Parameter("gain", "1", 1.0, 0.1, 10.0)]
    found = fit(lambda v: y - 0.7 - v["slope"] * v["gain"] * x, twins, tell=told.append)
    assert told[1] == "gain and slope are not separable by these data (|cos| 1.000)"
    assert found.refused == "these data do not determine slope and gain"
    assert found.values == {} and found.ci95 == {} and found.standard_errors == {}
    with pytest.raises(UserError, match="the fit was refused: these data do not determine slope and gain"):
        found["slope"]


def test_what_is_known_of_a_gain_separates_it_and_widens_its_twin_s_interval():
    # Known answer: slope = product / gain, so its relative variance is the product's and the gain's together.
    x, y = noisy_line()
    product = fit(line(x, y), [SLOPE, INTERCEPT], effective_samples=len(x))
    gain = Parameter("gain", "1", 1.0, 0.1, 10.0, uncertainty=0.02)
    found = fit(
        lambda v: y - v["intercept"] - v["slope"] * v["gain"] * x, [SLOPE, INTERCEPT, gain], effective_samples=len(x)
    )
    expected = np.hypot(product.standard_errors["slope"] / product["slope"], 0.02) * product["slope"]
    assert found["slope"] == pytest.approx(product["slope"], rel=1e-6)
    assert found.standard_errors["slope"] == pytest.approx(expected, rel=1e-4)
    assert found.identifiability.ties[0][:2] == ("gain", "slope")


@pytest.mark.parametrize(("low", "high", "side"), [(2.0, 10.0, "lower limit 2"), (-10.0, 1.0, "upper limit 1")])
def test_a_fit_that_ends_on_a_limit_is_refused(low, high, side):
    x, y = noisy_line()
    found = fit(line(x, y), [Parameter("slope", "V/A", 0.5 * (low + high), low, high), INTERCEPT])
    assert found.refused == f"slope is at its {side} V/A"
    assert found.values == {}
    assert found.ended_at["slope"] == pytest.approx(low if low > 0 else high, abs=1e-6)
    assert found.lines() == [f"refused: slope is at its {side} V/A"]


def test_an_impossible_value_is_refused_with_its_reason():
    x, y = noisy_line()

    def physical(values):
        return "a resistance cannot be below 0" if values["slope"] < 0.0 else None

    assert fit(line(x, y), [SLOPE, INTERCEPT], physical=physical).refused == ""
    assert fit(line(x, -y), [SLOPE, INTERCEPT], physical=physical).refused == "a resistance cannot be below 0"


def test_what_an_earlier_fit_found_is_weighed_in_as_if_its_data_were_next_to_these():
    x, y = noisy_line(count=60)
    first = fit(line(x[:25], y[:25]), [SLOPE, INTERCEPT], 25, noise=0.1)
    second = fit(line(x[25:], y[25:]), [SLOPE, INTERCEPT], 35, noise=0.1, earlier=[first])
    whole = fit(line(x, y), [SLOPE, INTERCEPT], 60, noise=0.1)
    for name in ("slope", "intercept"):
        assert second[name] == pytest.approx(whole[name], rel=1e-7)
    assert second.covariance == pytest.approx(whole.covariance, rel=1e-6)


def test_neighbours_of_an_autoregression_correlate_and_ends_of_runs_are_not_neighbours():
    values = autocorrelated(generator(3, "ar"), 20_000, 0.8)
    # standard error sqrt((1 - rho^2) / n) = 0.0042; five of them
    assert neighbours_correlation(values) == pytest.approx(0.8, abs=0.021)
    assert independent_samples(900, 0.8) == pytest.approx(100.0)
    assert independent_samples(900, -0.5) == 900.0
    pieces = np.array([1.0, 1.0, -1.0, -1.0])
    assert neighbours_correlation(pieces) == pytest.approx(1 / 4)
    assert neighbours_correlation(pieces, [slice(0, 2), slice(2, 4)]) == pytest.approx(2 / 4)


@pytest.mark.parametrize("rho", [0.0, 0.9])
def test_intervals_hold_the_truth_at_their_rate_also_in_correlated_noise(rho):
    # Of 100 intervals 95 % should hold the truth. The rule of the effective samples is asymptotic, so 93 % is asked of
    # the rate; 82 or fewer of 100 have then a probability of 2e-4. Without the rule, at rho 0.9, less than 50 do.
    x = np.linspace(-1.0, 1.0, 800)
    held = naive = 0
    for seed in range(100):
        y = 1.3 * x + 0.7 + 0.1 * autocorrelated(generator(seed, "coverage"), len(x), rho)
        held += fit(line(x, y), [SLOPE, INTERCEPT]).covers("intercept", 0.7)
        naive += fit(line(x, y), [SLOPE, INTERCEPT], len(x)).covers("intercept", 0.7)
    assert held > 82
    assert naive < 50 if rho else naive > 85


def test_the_profile_of_a_line_is_a_parabola_and_its_interval_the_normal_one():
    x, y = noisy_line()
    found = fit(line(x, y), [SLOPE, INTERCEPT], len(x), noise=0.1)
    tried, costs = found.profile("slope", count=7)
    assert costs == pytest.approx(((tried - found["slope"]) / found.standard_errors["slope"]) ** 2, abs=1e-6)
    low, high = found.profile_interval("slope")
    # 3.84 is 1.95996^2, rounded
    assert (high - low) / 2.0 == pytest.approx(1.9596 * found.standard_errors["slope"], rel=1e-4)


def test_the_profile_of_what_has_no_upper_end_is_open_above():
    # A time constant far above the data's length only shows as a slope: it has a lower bound and no upper one.
    # At 3000 s the data fall by 2e-4 in the mean, their own mean is known to 0.02 / sqrt(200) = 1.4e-3.
    t = np.linspace(0.0, 1.0, 200)
    y = np.exp(-t / 3000.0) + 0.02 * generator(5, "decay").standard_normal(200)
    parameters = [Parameter("tau", "s", 10.0, 0.1, 1e6)]
    found = fit(lambda v: y - np.exp(-t / v["tau"]), parameters, 200, noise=0.02)
    low, high = found.profile_interval("tau", width=40.0)
    assert 0.1 < low < 3000.0
    assert high == np.inf


@pytest.mark.parametrize(
    ("residual", "parameters", "message"),
    [
        (lambda v: np.full(5, np.nan), [SLOPE], "not finite in 5 rows at slope 1"),
        (lambda v: np.array([v["slope"]]), [SLOPE], "1 rows of data are too few for 1 parameters"),
        (lambda v: np.ones((2, 2)) * v["slope"], [SLOPE], r"shape \(2, 2\), one row of numbers is needed"),
        (lambda v: np.ones(9) * v["slope"], [SLOPE, SLOPE], "parameter slope: named twice"),
        (lambda v: np.ones(9), [], "no parameter to fit"),
    ],
)
def test_what_cannot_be_fitted_is_reported_in_a_line(residual, parameters, message):
    with pytest.raises(UserError, match=message):
        fit(residual, parameters)


def test_a_start_outside_its_limits_is_refused_where_it_is_written():
    with pytest.raises(UserError, match="parameter R: start -1.0 ohm is not between its limits 0 and 5"):
        Parameter("R", "ohm", -1.0, 0.0, 5.0)
