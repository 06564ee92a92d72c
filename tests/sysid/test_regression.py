"""Balances as one regression: its noise, columns that are noisy themselves, and what a test of a column is worth."""

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Equation, Recording
from ranger_sim.sysid.regression import Regression, autoregression, autoregression_above, explained, innovations

SIZE = 4000


def coloured(rng, size, memory=0.8):
    """Noise of deviation 1 that remembers."""
    white = rng.normal(size=size) * np.sqrt(1.0 - memory**2)
    return lfilter([1.0], [1.0, -memory], white)


def recording(response, columns, stand_ins=None, **more):
    size = len(response)
    valid = np.ones(size, dtype=bool)
    table = Table(np.arange(size) * 1e-3, {}, (slice(0, size),), "made")
    made = Equation("one", "M", "mechanical", "N", response, columns, valid, stand_ins or {})
    return Recording(table, {}, {"one": made}, **more)


def test_an_autoregression_is_found():
    rng = generator(1, "noise")
    noise = lfilter([1.0], [1.0, -1.2, 0.5], rng.normal(size=200_000))
    # deviation of a coefficient: at most 1 / sqrt(N) = 0.0022; five. Two and no more: a third does not pay for itself
    assert autoregression(noise, np.ones(len(noise), dtype=bool)) == pytest.approx([1.2, -0.5], abs=0.012)


def test_white_noise_has_no_autoregression():
    noise = generator(2, "noise").normal(size=20_000)
    assert len(autoregression(noise, np.ones(len(noise), dtype=bool))) == 0


@pytest.mark.parametrize("memory", [0.0, 0.3, 0.6, 0.8])
def test_noise_found_above_a_frequency_is_hardly_another_with_a_slow_effect_below_it(memory):
    rng = generator(3, f"noise {memory}")
    slow = np.sin(2.0 * np.pi * 0.012 * np.arange(20_000))
    noise = coloured(rng, 20_000, memory)
    good = np.ones(len(noise), dtype=bool)
    coefficients, deviation = autoregression_above(noise, good, 0.08)
    beside, deviation_beside = autoregression_above(noise + slow, good, 0.08)
    # Known answer: innovations have the deviation sqrt(1 - memory^2), which 20,000 samples tell to 0.5 %
    true_deviation = np.sqrt(1.0 - memory**2)
    assert deviation == pytest.approx(true_deviation, rel=0.02)
    # With more power below, memories up to the end of their one-sided interval are noise: two steps of 0.02 here
    assert 0.98 < deviation_beside / true_deviation < 1.04
    # the slow part counts as under the noise's true spectrum, or less by the interval's end: 0.84 for a memory of 0.8
    white = innovations(beside, slow) / deviation_beside
    true = innovations(np.array([memory]), slow) / true_deviation
    assert 0.7 < np.linalg.norm(white[100:]) / np.linalg.norm(true[100:]) < 1.05
    # all of the spectrum together takes the slow part for noise
    plain = autoregression(noise + slow, good)
    assert np.linalg.norm(innovations(plain, slow)[100:]) < 0.8 * np.linalg.norm(true[100:]) * deviation


@pytest.mark.parametrize("memory", [0.8, 0.9])
def test_slow_noise_is_not_taken_for_much_less_than_it_is(memory):
    """1,500 rows, of which 12 % of the frequencies are below: the likeliest memory alone had less than 0.4 of the power
    at frequency 0 in 18 of 60 recordings with a memory of 0.8 and in 27 with 0.9."""
    power = []
    for seed in range(60):
        noise = coloured(generator(seed, "slow noise"), 1_500, memory)
        coefficients, deviation = autoregression_above(noise, np.ones(1_500, dtype=bool), 0.12)
        power.append((deviation / (1.0 - np.sum(coefficients))) ** 2 * (1.0 - memory) ** 2 / (1.0 - memory**2))
    # 5 % by the interval; more than 8 of 60 come by chance one time in 100
    assert np.count_nonzero(np.array(power) < 0.4) <= 8
    assert 0.8 < np.median(power) < 2.5  # of memories up to 0.94, which it cannot always tell from these


def test_intervals_hold_with_noise_that_remembers():
    """Of 200 fits as many 95 % intervals hold as 200 tosses of such a coin allow, one time in 10^4 apart."""
    held = 0
    for seed in range(200):
        rng = generator(seed, "interval")
        x = np.cumsum(rng.normal(size=SIZE)) * 0.02
        made = Regression([recording(2.0 * x + coloured(rng, SIZE), {"slope": x, "level": np.ones(SIZE)})])
        error = np.sqrt(made.covariance[0, 0])
        held += abs(made.values["slope"] - 2.0) < 1.96 * error
    assert stats.binom.ppf(1e-4, 200, 0.95) <= held <= 199


def test_a_noisy_column_biases_least_squares_and_not_a_fit_by_its_substitute():
    rng = generator(3, "errors in variables")
    truth = np.sin(np.arange(SIZE) * 0.02)
    measured, other = truth + 0.5 * rng.normal(size=SIZE), truth + 0.5 * rng.normal(size=SIZE)
    response = 3.0 * truth + 0.1 * rng.normal(size=SIZE)
    plain = Regression([recording(response, {"slope": measured})])
    # attenuated by var / (var + noise) = 0.5 / 0.75; the whitening of a wrong model leaves it in that region
    assert plain.values["slope"] < 2.3
    with_stand_in = Regression([recording(response, {"slope": measured}, {"slope": other})])
    error = float(np.sqrt(with_stand_in.covariance[0, 0]))
    assert abs(with_stand_in.values["slope"] - 3.0) < 4.0 * error
    assert error < 0.1


def test_what_chance_explains_is_a_chi_square():
    """Mean of 300 chi-squares of 3 degrees: 3 with deviation sqrt(6 / 300) = 0.14; five of them either way."""
    found = []
    for seed in range(300):
        rng = generator(seed, "chance")
        x = np.cumsum(rng.normal(size=1500)) * 0.03
        made = Regression([recording(x + coloured(rng, 1500), {"slope": x})])
        columns = made.columns([{"one": np.column_stack([np.sin(x), np.cos(x), x**2])}])
        chi2, freedom = explained(columns.T @ columns, columns.T @ made.residual)
        assert freedom == 3
        found.append(chi2)
    assert np.mean(found) == pytest.approx(3.0, abs=0.7)
    # above the 99 % quantile: 3 expected of 300; more than 14 in one of 10^6
    assert sum(each > stats.chi2.ppf(0.99, 3) for each in found) <= 14


def test_the_chi_square_of_a_real_column_is_its_size_over_its_noise():
    rng = generator(5, "real")
    x = np.sin(np.arange(SIZE) * 0.1)
    extra = np.sign(np.sin(np.arange(SIZE) * 0.013))
    made = Regression([recording(x + 0.2 * extra + rng.normal(size=SIZE), {"slope": x})])
    columns = made.columns([{"one": extra[:, None]}])
    chi2, _ = explained(columns.T @ columns, columns.T @ made.residual)
    # 0.2^2 * 4000 = 160, deviation 2 * sqrt(160) = 25; five
    assert chi2 == pytest.approx(160.0, abs=126.0)
    assert chi2 > 60.0


def test_products_next_to_the_base_are_those_of_the_whole_columns():
    rng = generator(8, "products")
    x, other = np.sin(np.arange(SIZE) * 0.1), rng.normal(size=SIZE)
    made = Regression([recording(x + rng.normal(size=SIZE), {"slope": x}, {"slope": x + 0.1 * other})])
    columns = [{"one": np.column_stack([other, np.cos(np.arange(SIZE) * 0.1)])}]
    white = made.whitened(columns)
    whole = made.columns(columns)
    assert made.product(white, made.shadow(white), made.residual) == pytest.approx(whole.T @ made.residual)
    assert made.product(white, made.shadow(white), whole) == pytest.approx(whole.T @ whole)


def sharing(seed, parameters):
    """(regression, their column) of two equations whose noises, of variance 2, have half in common."""
    rng = generator(seed, "shared")
    common, x = rng.normal(size=SIZE), np.sin(np.arange(SIZE) * 0.1)
    table = Table(np.arange(SIZE) * 1e-3, {}, (slice(0, SIZE),), "made")
    both = {
        name: Equation(name, "M", "mechanical", "N", x + common + rng.normal(size=SIZE), {each: x}, np.ones(SIZE, bool))
        for name, each in zip(("one", "other"), parameters, strict=True)
    }
    return Regression([Recording(table, {}, both)]), x


def test_equations_that_share_noise_show_by_how_much():
    made, x = sharing(6, ("one", "other"))
    assert made.shared["one", "other"] == pytest.approx(0.5, abs=0.06)
    ones = np.ones((SIZE, 1))

    def inflation(columns):
        white = made.whitened([columns])
        shadow = made.shadow(white)
        return made.inflation(white, shadow, made.gram(white, shadow))

    # what the base takes of a column in one equation stands in the other, but is little
    assert inflation({"one": ones}) == pytest.approx(1.0, abs=0.01)
    # the same column in both: variance of the sum is 1 + correlation
    assert inflation({"one": ones, "other": ones}) == pytest.approx(1.5, abs=0.1)
    # the same number, from the rows themselves
    columns = {"one": np.column_stack([x**2, ones]), "other": np.column_stack([x**3 + 1.0, -ones])}
    beside = made.columns([columns])
    here, there = made.both["one", "other"]
    worst = np.max(np.abs(np.sum(beside[here] * beside[there], axis=0)))
    known = 1.0 + 2.0 * made.shared["one", "other"] * worst * 2 / np.sum(beside**2)
    assert inflation(columns) == pytest.approx(known, rel=1e-9)


def test_a_parameter_of_two_equations_that_share_noise_is_known_as_well_as_they_show_together():
    """Of both with noise of variance 2, correlated by 1/2, the mean has (1 + 1/2) / 2 of the variance of one."""
    made, x = sharing(8, ("slope", "slope"))
    # 10 %: both variances and the correlation are estimated from these rows
    assert made.covariance[0, 0] == pytest.approx(0.75 * 2.0 / np.sum(x**2), rel=0.1)


def test_products_of_columns_next_to_the_base_are_those_of_the_rows():
    rng = generator(5, "gram")
    x, other = np.sin(np.arange(SIZE) * 0.1), np.sin(np.arange(SIZE) * 0.23)
    made = Regression([recording(x + rng.normal(size=SIZE), {"slope": x}, {"slope": x + 0.1 * other})])
    columns = [{"one": np.column_stack([other, np.cos(np.arange(SIZE) * 0.1), x + 0.1 * other])}]
    white, whole = made.whitened(columns), made.columns(columns)
    gram = made.gram(white, made.shadow(white))
    assert gram == pytest.approx(whole.T @ whole, rel=1e-9, abs=1e-6)
    # a column of the stand-ins leaves nothing, not rounding
    assert not gram[2].any() and not gram[:, 2].any()


def test_columns_that_are_the_same_are_named_and_not_separated():
    rng = generator(7, "twins")
    x = np.sin(np.arange(SIZE) * 0.1)
    made = Regression([recording(x + rng.normal(size=SIZE), {"one": x, "twin": 2.0 * x, "idle": np.zeros(SIZE)})])
    assert made.unseparable in (["one"], ["twin"])
    assert made.idle == ["idle"]


def test_too_few_samples_are_refused_in_a_line():
    with pytest.raises(UserError, match="samples count, too few for 1 parameters"):
        Regression([recording(np.ones(12), {"level": np.ones(12)})])


def repeated(rng, effect=0.0):
    """Forty repeats of twelve places; a response of noise 0.1 and of `effect` times a wave over the places."""
    place = np.tile(np.arange(12), 40)
    wave = np.sin(2.0 * np.pi * place / 12.0)
    response = 2.0 + effect * wave + 0.1 * rng.standard_normal(len(place))
    columns = {"offset": np.ones(len(place))}
    valid = np.ones(len(place), dtype=bool)
    equation = Equation("force", "M", "mechanical", "N", response, columns, valid)
    table = Table(0.01 * np.arange(len(place)), {}, (slice(0, len(place)),), "made up")
    return Recording(table, {}, {"force": equation}, whitened=False, repeats={"force": place}), wave


def test_noise_is_what_differs_between_repeats_however_large_the_misfit_is():
    """A wave of ten deviations leaves it as it was; the limit of 95 % of 460 degrees of freedom is 1.06 of 0.1."""
    for effect in (0.0, 1.0):
        recording, _ = repeated(generator(3, "repeats"), effect)
        assert Regression([recording]).whitening["force"].deviation == pytest.approx(0.106, rel=0.1)
    recording.repeats = {}
    assert Regression([recording]).whitening["force"].deviation > 0.5


def test_what_is_known_of_a_parameter_counts_as_a_measurement_of_it():
    """480 rows of noise 0.106 know the offset to 0.0048; what is known of it as well halves the variance."""
    recording, _ = repeated(generator(3, "repeats"))
    free = Regression([recording])
    error = float(np.sqrt(free.covariance[0, 0]))
    recording.priors = {"offset": (1.0, error)}
    known = Regression([recording])
    assert known.values["offset"] == pytest.approx(0.5 * (1.0 + free.values["offset"]), rel=1e-3)
    assert np.sqrt(known.covariance[0, 0]) == pytest.approx(error / np.sqrt(2.0), rel=1e-3)


def test_an_equation_has_no_less_noise_than_its_floor():
    recording, _ = repeated(generator(3, "repeats"))
    recording.floors = {"force": 1.0}
    assert Regression([recording]).whitening["force"].deviation == pytest.approx(1.0, rel=0.02)


def two_equations(names, seed=9):
    """A recording in which each of these equations has its own slope, and noise in common."""
    rng = generator(seed, "two equations")
    common, x = rng.normal(size=SIZE), np.sin(np.arange(SIZE) * 0.1)
    table = Table(np.arange(SIZE) * 1e-3, {}, (slice(0, SIZE),), "held")
    valid = np.ones(SIZE, dtype=bool)
    equations = {
        name: Equation(name, "M", "m", "N", 2.0 * x + common + rng.normal(size=SIZE), {f"slope_{name}": x}, valid)
        for name in names
    }
    return Recording(table, {}, equations)


@pytest.mark.parametrize(("trained", "held"), [(("one",), ("one", "other")), (("one", "other"), ("one",))])
def test_held_out_data_are_judged_in_the_equations_that_training_has_too(trained, held):
    known = Regression([two_equations(trained)])
    made = Regression([two_equations(held, 10)], noise=known)
    assert (made.equations, made.names, made.shared) == (["one"], ["slope_one"], {})
    assert made.values["slope_one"] == pytest.approx(2.0, abs=0.15)
    assert made.whitened([{"other": np.ones((SIZE, 1))}]) == {}


def test_held_out_data_without_an_equation_of_the_training_are_refused_in_a_line():
    known = Regression([two_equations(("one",))])
    with pytest.raises(UserError, match="held: no equation that the other recordings have can be made of it"):
        Regression([two_equations(("other",))], noise=known)
