"""Noise of a balance as its channels make it: known answers, dense matrices, an effect that no memory shows."""

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid import noise, noise_of_channels
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Equation, Recording
from ranger_sim.sysid.regression import Noise, Regression, Whitening
from ranger_sim.sysid.weak_form import WeakForm

SECOND = np.array([1.0, -2.0, 1.0])
ONE = np.ones(1)


def dense(covariance, rows, run):
    """The covariance of rows as a whole matrix."""
    apart = np.abs(rows[:, None] - rows)
    padded = np.append(covariance, 0.0)
    return np.where(run[:, None] == run, padded[np.minimum(apart, len(covariance))], 0.0)


def recording(response, valid, sources):
    count = len(response)
    table = Table(np.arange(count) * 1e-3, {"y": response}, (slice(0, count),), "a")
    equation = Equation("y", "M", "mechanical", "N", response, {"one": np.ones(count)}, valid, sources=sources)
    return Recording(table, {}, {"y": equation}, {})


def test_a_second_difference_has_the_correlations_1_and_minus_two_thirds_and_a_sixth():
    found = noise_of_channels.autocovariances((ONE, SECOND), 0.0, 0.0, 1)
    assert found == pytest.approx(np.array([[1.0, 0.0, 0.0], [1.0, -2.0 / 3.0, 1.0 / 6.0]]))


def test_noise_with_a_memory_has_its_correlations():
    found = noise_of_channels.autocovariances((ONE, SECOND), 0.5, 0.0, 1)
    assert found[0, :4] == pytest.approx([1.0, 0.5, 0.25, 0.125], abs=1e-4)  # a memory below 0.003 is not followed


def test_of_every_second_row_only_every_second_lag_is_left():
    assert noise_of_channels.autocovariances((ONE, SECOND), 0.0, 0.0, 2)[1] == pytest.approx([1.0, 1.0 / 6.0])


def test_rows_with_gaps_are_whitened_as_by_the_whole_matrix():
    draw = generator(1, "noise of channels")
    rows = np.flatnonzero(draw.random(60) < 0.7)
    run = (rows > 30).astype(int)
    covariance = np.array([1.0, -0.6, 0.15])
    columns = draw.normal(size=(len(rows), 3))
    lower = noise_of_channels.factor(covariance, rows, run)
    wanted = np.linalg.solve(np.linalg.cholesky(dense(covariance, rows, run)), columns)
    assert noise_of_channels.whitened(lower, columns) == pytest.approx(wanted, rel=1e-9)


def test_surrogates_have_the_covariance():
    covariance = np.array([1.0, -0.6, 0.15])
    drawn = noise_of_channels.surrogates(covariance, 2.0, 500, 400, 3, "some")
    found = [np.mean(drawn[: 500 - lag] * drawn[lag:]) for lag in range(4)]
    # 200,000 products with a deviation of up to 1.4 times 4, correlated over a few rows
    assert found == pytest.approx([4.0, -2.4, 0.6, 0.0], abs=0.06)


def test_the_weights_of_a_triangle_are_those_of_its_means():
    draw = generator(2, "noise of channels")
    values = draw.normal(size=60)
    table = Table(np.arange(60) * 1e-3, {"x": values}, (slice(0, 60),), "a")
    weak = WeakForm(table, values, 3e-3)
    lines, second = weak.sources()
    assert weak.straight(values)[30] == pytest.approx(lines @ values[27:34])
    assert weak.acceleration[30] * (3e-3) ** 2 == pytest.approx(second @ values[27:34])


def test_the_deviations_of_two_channels_are_found():
    draw = generator(4, "noise of channels")
    left = 0.02 * draw.normal(size=4000) + np.convolve(draw.normal(size=4002), SECOND, "valid")
    part = Regression([recording(left, np.ones(4000, dtype=bool), (ONE, SECOND))], noise=plain()).parts["y"]
    found = noise_of_channels.settled(part, np.zeros((4000, 0)), np.zeros((4000, 0)), left)
    # at frequency 0 only the first channel's power is left: its share is known to about 15 % by some 100 frequencies
    whole = found.covariance[0] + 2.0 * np.sum(found.covariance[1:])
    assert np.mean(found.white**2) * whole == pytest.approx(0.02**2, rel=0.4)


def plain():
    return Noise({"y": Whitening(np.zeros(0), 1.0)})


def chi2_of(whitening, there, column):
    regression = Regression([there], noise=Noise({"y": whitening}))
    seen = regression.columns([{"y": column[:, None]}])[:, 0]
    return float(seen @ regression.residual) ** 2 / float(seen @ seen)


def test_a_slow_effect_under_twice_differentiated_noise_is_seen_across_gaps():
    draw = generator(5, "noise of channels")
    count = 4000
    column = np.sin(2.0 * np.pi * 3.0 * np.arange(count) / count)
    left = 0.02 * draw.normal(size=count) + np.convolve(draw.normal(size=count + 2), SECOND, "valid")
    valid = np.arange(count) % 100 >= 15
    size = 10.0 * 0.02 / np.sqrt(0.5 * count * 0.85)  # ten deviations of the slow noise alone
    there = recording(left + size * column, valid, (ONE, SECOND))
    part = Regression([there], noise=plain()).parts["y"]
    one = np.ones((count, 1))
    found = noise_of_channels.settled(part, one, one, part.response)
    ours = Whitening(np.zeros(0), float(np.std(found.white)), found.covariance)
    memory = noise.autoregression(part.response, part.counted)
    usual = Whitening(memory, float(np.std(left)))
    # of 100: the noise of the second channel, and rows that do not count, whose forecasts are worse, take a part
    assert 30.0 < chi2_of(ours, there, column) < 170.0
    assert chi2_of(usual, there, column) < 10.0


def test_noise_that_remembers_is_not_taken_for_that_of_channels():
    draw = generator(6, "noise of channels")
    left = np.zeros(3000)
    for row in range(2, 3000):  # a resonance
        left[row] = 1.6 * left[row - 1] - 0.9 * left[row - 2] + draw.normal()
    part = Regression([recording(left, np.ones(3000, dtype=bool), (ONE, SECOND))], noise=plain()).parts["y"]
    nothing = np.zeros((3000, 0))
    shocks = np.convolve(left, [1.0, -1.6, 0.9])[:3000]
    assert not noise_of_channels.settled(part, nothing, nothing, left).likely(shocks, part.counted)
