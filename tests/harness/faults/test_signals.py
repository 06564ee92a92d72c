"""How values are falsified, each signal alone: known answers, both signs, limits."""

import math

import pytest

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.harness.faults import signals

MS = 1_000_000


def begun(kind, value=0.0, seed=1, **parameters):
    signal = kind(RandomStream(seed, "test"), **parameters)
    signal.begin(value, 0)
    return signal


def test_stuck_stays_at_its_start_or_at_its_level():
    assert [begun(signals.Stuck, 3.5, level=math.nan).shown(x, 0) for x in (-9.0, 9.0)] == [3.5, 3.5]
    assert begun(signals.Stuck, 3.5, level=-2.0).shown(9.0, 0) == -2.0


def test_offset_scale_and_sign_are_what_they_are_called():
    assert begun(signals.Offset, offset=-0.5).shown(2.0, 0) == 1.5
    assert begun(signals.Scale, factor=-1.5).shown(2.0, 0) == -3.0
    assert begun(signals.ScaleFromStart, 10.0, factor=3.0).shown(8.0, 0) == 4.0
    assert begun(signals.Inverted).shown(2.0, 0) == -2.0


def test_drift_counts_from_its_start():
    signal = signals.Drift(RandomStream(1, "test"), rate=-4.0)
    signal.begin(0.0, 500 * MS)
    assert [signal.shown(1.0, now * MS) for now in (500, 750, 1500)] == [1.0, 0.0, -3.0]


def test_noise_is_constant_for_250_microseconds_and_has_its_deviation():
    signal = begun(signals.Noise, deviation=2.0)
    first = signal.shown(0.0, 0)
    assert signal.shown(5.0, 249_999) == 5.0 + first
    errors = [signal.shown(0.0, 250_000 * n) for n in range(1, 4001)]
    assert len(set(errors)) == 4000
    # the deviation of 4000 values errs by 1.1 %: four of these
    assert math.sqrt(sum(e * e for e in errors) / 4000) == pytest.approx(2.0, rel=0.045)


@pytest.mark.parametrize("height", [2.0, -2.0])
def test_spikes_begin_at_once_last_so_long_and_pause_as_long_on_average(height):
    signal = begun(signals.Spike, height=height, length_ms=1.0, pause_ms=4.0)
    shown = [signal.shown(1.0, 250_000 * n) for n in range(200_000)]
    assert shown[:4] == [1.0 + height] * 4
    assert shown[4] == 1.0
    assert set(shown) == {1.0, 1.0 + height}
    # a pause ends at the next sample, so it is 4 ms and half a sample on average: 1 of 5.125; 9756 spikes, 4 x 0.9 %
    assert sum(value != 1.0 for value in shown) / len(shown) == pytest.approx(1.0 / 5.125, rel=0.036)


def test_a_pause_of_nothing_leaves_no_gap():
    signal = begun(signals.DropOut, level=-7.0, length_ms=1.0, pause_ms=0.0)
    assert {signal.shown(1.0, 250_000 * n) for n in range(100)} == {-7.0}


def test_chatter_shows_both_levels_and_nothing_else_while_it_lasts():
    signal = begun(signals.Chatter, low=0.2, high=2.1, length_ms=100.0, pause_ms=1e6)
    shown = [signal.shown(1.0, 250_000 * n) for n in range(400)]
    assert set(shown) == {0.2, 2.1}
    assert 160 < shown.count(2.1) < 240  # 400 throws of a coin: four deviations of 10
    assert signal.shown(1.0, 100 * MS) == 1.0


def test_a_delay_shows_the_value_of_then_and_that_of_the_start_before():
    signal = begun(signals.Delay, 100.0, delay_ms=1.0)
    assert [signal.shown(100.0 + n, 250_000 * n) for n in range(1, 8)] == [100, 100, 100, 100, 101, 102, 103]


def test_quantisation_takes_the_nearest_step_on_both_sides_of_zero():
    signal = begun(signals.Quantisation, step=0.5)
    pairs = {0.2: 0.0, 0.3: 0.5, 0.25: 0.5, -0.2: 0.0, -0.3: -0.5, -0.25: 0.0, 1.7: 1.5, -1.7: -1.5}
    assert {x: signal.shown(x, 0) for x in pairs} == pairs


def test_saturation_clips_at_both_ends_and_nowhere_else():
    signal = begun(signals.Saturation, low=-1.0, high=2.0)
    assert [signal.shown(x, 0) for x in (-3.0, -1.0, 0.5, 2.0, 3.0)] == [-1.0, -1.0, 0.5, 2.0, 2.0]
    moved = begun(signals.SaturationFromStart, 10.0, low=-1.0, high=2.0)
    assert [moved.shown(x, 0) for x in (3.0, 9.5, 13.0)] == [9.0, 9.5, 12.0]
