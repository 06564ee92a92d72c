"""Filters, derivatives and even stamps on signals whose answers are known, run by run."""

import math

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Table

STEP_S = 0.01


def table(count=400, gap_s=0.0, **columns):
    """Two runs of half the rows each, the second one later by a gap."""
    time_s = STEP_S * np.arange(count)
    half = count // 2
    time_s[half:] += gap_s
    made = {name: np.asarray(column, float) for name, column in columns.items()}
    return Table(time_s, made or {"x": time_s.copy()}, (slice(0, half), slice(half, count)), "made", {})


def test_a_filter_works_on_each_run_alone():
    one = table()
    column = np.repeat([1.0, 5.0], 200)
    assert signals.smooth(one, column, 7.0) == pytest.approx(column, abs=1e-12)
    assert signals.derivative(one, column, 7.0) == pytest.approx(np.zeros(400), abs=1e-12)


def test_the_derivative_of_a_ramp_is_its_slope_away_from_the_ends():
    one = table()
    rate = signals.derivative(one, 3.0 * one.time_s, 4.0)
    for inside in (slice(30, 170), slice(230, 370)):  # the Gaussian ends at four deviations: 0.06 % are beyond
        assert rate[inside] == pytest.approx(np.full(140, 3.0), rel=1e-3)


@pytest.mark.parametrize("width", [0.05, 0.3, 0.6, 0.74, 0.75, 1.0, 1.5])
def test_a_ramp_has_its_slope_under_a_gaussian_narrower_than_a_sample_too(width):
    """It had a twelfth of it under 0.3 samples: a current's lag, logged every 10 ms, came out twelve times as long."""
    one = table()
    rate = signals.derivative(one, 3.0 * one.time_s, width)
    for inside in (slice(10, 190), slice(210, 390)):
        assert rate[inside] == pytest.approx(np.full(180, 3.0), rel=1e-3)
    single = Table(np.array([0.0, 0.1, 0.2, 5.0]), {}, (slice(0, 3), slice(3, 4)))
    assert signals.derivative(single, np.array([0.0, 1.0, 2.0, 7.0]), width)[3] == 0.0


@pytest.mark.parametrize("width", [0.75, 1.5])
def test_from_three_quarters_of_a_sample_on_the_rate_of_a_sine_is_the_gaussian_s(width):
    """Differences over two samples would make it smaller by 4.5 %."""
    one = table()
    omega = 2.0 * math.pi / 12.0  # per sample
    rate = signals.derivative(one, np.sin(omega * np.arange(400)), width)
    expected = omega / STEP_S * math.exp(-0.5 * (width * omega) ** 2) * np.cos(omega * np.arange(400))
    assert rate[40:160] == pytest.approx(expected[40:160], abs=0.003 * omega / STEP_S)


def test_a_jump_under_a_narrow_gaussian_is_a_difference_over_two_samples():
    one = table()
    jump = (np.arange(400) >= 100).astype(float)
    rate = signals.derivative(one, jump, 0.05)
    assert rate[[98, 99, 100, 101]] == pytest.approx([0.0, 50.0, 50.0, 0.0])


def test_a_gaussian_of_so_many_samples_weakens_a_sine_by_its_known_factor():
    one = table()
    omega = 2.0 * math.pi / 40.0  # per sample
    smoothed = signals.smooth(one, np.sin(omega * np.arange(400)), 5.0)
    expected = math.exp(-0.5 * (5.0 * omega) ** 2) * np.sin(omega * np.arange(400))
    assert smoothed[40:160] == pytest.approx(expected[40:160], abs=1e-3)


def test_a_lag_begins_at_0_in_each_run_and_reaches_63_percent_after_its_time_constant():
    one = table()
    behind = signals.lagged(one, np.ones(400), 0.5)
    expected = 1.0 - np.exp(-STEP_S * (np.arange(200) + 1) / 0.5)
    assert behind[:200] == pytest.approx(expected) and behind[200:] == pytest.approx(expected)
    assert signals.lagged(one, -np.ones(400), 0.5)[49] == pytest.approx(-(1.0 - math.exp(-1.0)))


def test_an_integral_is_by_trapezoids_and_goes_straight_over_a_gap():
    one = table(gap_s=1.0)
    whole = signals.integral(one, np.full(400, 2.0))
    assert whole[0] == 0.0 and whole[199] == pytest.approx(3.98) and whole[200] == pytest.approx(6.0)
    ramp = signals.integral(one, one.time_s)
    assert ramp[-1] == pytest.approx(0.5 * one.time_s[-1] ** 2)


def test_even_stamps_stay_and_uneven_ones_become_even_by_straight_lines():
    one = table(gap_s=0.5)
    assert signals.uniform(one) is one
    jitter = one.time_s.copy()
    jitter[[5, 205]] += 0.3 * STEP_S
    uneven = Table(jitter, {"x": 2.0 * jitter + 1.0}, one.runs, "made", {})
    even = signals.uniform(uneven)
    assert even.runs == (slice(0, 200), slice(200, 400)) and even.name == "made"
    assert even.time_s == pytest.approx(one.time_s) and even.columns["x"] == pytest.approx(2.0 * one.time_s + 1.0)


@pytest.mark.parametrize("shift, same", [(0.009, True), (0.011, False)])
def test_stamps_that_are_off_by_less_than_a_hundredth_of_a_step_count_as_even(shift, same):
    one = table()
    stamps = one.time_s.copy()
    stamps[50:] += shift * STEP_S
    assert (signals.uniform(moved := Table(stamps, one.columns, one.runs, "made", {})) is moved) == same


def test_a_channel_that_rests_on_a_count_is_found_and_one_that_moves_or_has_no_counts_is_not():
    """0.3 s at rest, next to a count's edge so that it flickers between two, between motions at 0.7 counts a row."""
    time_s = np.arange(0.0, 0.9, 0.001)
    moves = np.interp(time_s, [0.0, 0.3, 0.6, 0.9], [0.0, 210.49, 210.49, 421.0])
    flicker = generator(1, "flicker").normal(scale=0.05, size=len(time_s))
    table = Table(time_s, {}, (slice(0, len(time_s)),), "counts")
    rests = signals.on_one_count(table, 0.002 * np.round(moves + flicker), 24)
    assert np.all(rests[315:585]) and not np.any(rests[:285]) and not np.any(rests[615:])
    assert not np.any(signals.on_one_count(table, 0.002 * (moves + flicker), 24))
