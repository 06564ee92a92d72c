"""What a plot is shown: no spike is lost, gaps stay gaps, and the memory of a running robot is bounded."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.tools.panel import channels
from ranger_sim.tools.panel.channels import FINE_S, Memory, thinned

PERIOD = 0.002


def grid(count, first=0.0):
    return first + PERIOD * np.arange(count)


def test_one_sample_of_a_million_is_seen():
    values = np.zeros(1_000_000, np.float32)
    values[654_321] = 7.0
    trace = thinned(grid(1_000_000), values, 0.0, 2000.0, 500, PERIOD)
    assert len(trace.x) <= 502 and trace.high.max() == 7.0 and trace.low.min() == 0.0
    at = trace.x[int(np.argmax(trace.high))]
    assert at <= 654_321 * PERIOD < at + 4.0  # 2000 s in 500 points


def test_few_samples_are_shown_as_they_are():
    values = np.arange(50, dtype=np.float32)
    trace = thinned(grid(50), values, 0.01, 0.03, 100, PERIOD)
    assert trace.high is None
    assert list(trace.low) == list(range(4, 16))  # and one more at each edge, where the line goes on


def test_buckets_do_not_move_with_the_window():
    rng = np.sin(np.arange(5000) * 0.37).astype(np.float32)
    first = thinned(grid(5000), rng, 0.0, 8.0, 400, PERIOD)
    second = thinned(grid(5000), rng, 0.1, 8.1, 400, PERIOD)
    of_first = dict(zip(np.round(first.x[1:-1], 6), zip(first.low[1:-1], first.high[1:-1], strict=True), strict=True))
    common = [k for k, x in enumerate(np.round(second.x, 6)) if x in of_first][1:-1]
    assert len(common) > 350
    assert all(of_first[np.round(second.x[k], 6)] == (second.low[k], second.high[k]) for k in common)


@pytest.mark.parametrize("points", [5000, 100])
def test_gaps_without_data_have_no_line(points):
    times = np.concatenate([grid(1000), grid(1000, first=3.0)])
    trace = thinned(times, np.ones(2000, np.float32), 0.0, 5.0, points, PERIOD)
    in_gap = (trace.x > 2.1) & (trace.x < 2.9)
    between = trace.low[(trace.x > 1.99) & (trace.x < 3.01)]
    assert np.isnan(between).any()
    assert np.isnan(trace.low[in_gap]).all()
    assert not np.isnan(trace.low[(trace.x > 0.1) & (trace.x < 1.9)]).any()


def test_a_quantity_that_is_sent_when_it_changes_holds_its_value_between():
    times, values = np.array([0.0, 2.0, 5.0]), np.array([1.0, 4.0, 2.0], np.float32)
    trace = thinned(times, values, 1.0, 6.0, 100, None)
    shown = dict(zip(trace.x.tolist(), trace.low.tolist(), strict=True))
    assert shown[6.0] == 2.0 and shown[5.0] == 2.0
    assert np.interp([1.999999, 2.0, 4.999999], trace.x, trace.low).tolist() == [1.0, 4.0, 4.0]
    assert (np.diff(trace.x) > 0).all()  # a plot has one point at an instant


def test_of_several_values_at_one_time_the_last_one_counts():
    trace = thinned(np.array([0.0, 2.0, 2.0]), np.array([1.0, 9.0, 4.0], np.float32), 0.0, 3.0, 100, None)
    assert np.interp([1.0, 2.0, 3.0], trace.x, trace.low).tolist() == [1.0, 4.0, 4.0]
    assert (np.diff(trace.x) > 0).all()


def test_of_many_changes_in_a_bucket_the_extremes_are_shown():
    times = np.linspace(0.0, 10.0, 10_001)
    values = np.where(np.arange(10_001) % 2, 1.0, -1.0).astype(np.float32)
    trace = thinned(times, values, 0.0, 10.0, 50, None)
    assert (trace.low[:-1] == -1.0).all() and (trace.high[:-1] == 1.0).all()


@given(st.lists(st.floats(-1e6, 1e6, width=32), min_size=1, max_size=400), st.integers(1, 60))
def test_the_extremes_of_a_window_are_those_of_its_samples(values, points):
    samples = np.array(values, np.float32)
    times = grid(len(samples))
    trace = thinned(times, samples, times[0], times[-1] + PERIOD, points, PERIOD)
    high = trace.low if trace.high is None else trace.high
    assert np.nanmin(trace.low) == samples.min() and np.nanmax(high) == samples.max()


def test_nothing_is_shown_of_nothing():
    empty = np.empty(0)
    assert len(thinned(empty, empty.astype(np.float32), 0.0, 1.0, 10, PERIOD).x) == 0
    assert len(thinned(grid(5), np.ones(5, np.float32), 1.0, 1.0, 10, PERIOD).x) == 0


def filled(seconds, rows=10):
    """A memory of one column: the time itself, with a spike at 1 s."""
    memory = Memory(1, PERIOD)
    times = grid(round(seconds / PERIOD))
    values = times.astype(np.float32)[:, np.newaxis].copy()
    values[500] = 1e6
    for first in range(0, len(times), rows):
        memory.append(times[first : first + rows], values[first : first + rows])
    return memory


@pytest.mark.parametrize(
    ("coarse", "width_s"), [(((0.1, 600.0), (1.0, 3600.0)), 0.1), (((0.1, 5.0), (1.0, 50.0)), 1.0)]
)
def test_a_spike_is_seen_when_its_samples_are_gone(monkeypatch, coarse, width_s):
    monkeypatch.setattr(channels, "FINE_S", 2.0)
    monkeypatch.setattr(channels, "COARSE_S", coarse)
    memory = filled(20.5)
    fine, _ = memory.fine.rows()
    assert fine[0] > 18.4  # the samples of the spike are gone
    trace = memory.trace(0, 0.0, 20.5, 400)
    assert trace.high.max() == 1e6
    assert abs(trace.x[int(np.argmax(trace.high))] - 1.0) < width_s + 1e-9
    # what is shown reaches to the newest sample: also the extremes that are still growing
    assert trace.x[-1] == pytest.approx(20.5 - (20.5 % width_s or width_s), abs=1e-6)
    assert trace.low[-1] == pytest.approx(trace.x[-1], abs=1e-6) and trace.high[-1] == pytest.approx(20.498)


def test_at_the_beginning_a_window_that_reaches_before_it_is_still_shown_sample_by_sample():
    memory = filled(3.0)
    trace = memory.trace(0, -7.0, 3.0, 2000)
    assert trace.high is None and len(trace.x) == 1500


def test_the_memory_of_a_running_robot_does_not_grow():
    memory = Memory(1, PERIOD)
    parts = [memory.fine, *(rows for extremes in memory.coarse for rows in (extremes.low, extremes.high))]
    room = [rows.times.nbytes + rows.values.nbytes for rows in parts]
    for minute in range(150):  # two hours and a half: every part was full twice
        memory.append(60.0 * minute + grid(30_000), np.zeros((30_000, 1), np.float32))
    times, _ = memory.fine.rows()
    assert [rows.times.nbytes + rows.values.nbytes for rows in parts] == room
    assert times[-1] - times[0] <= FINE_S and memory.newest == pytest.approx(8999.998)
    assert [each.first() for each in memory.coarse] == pytest.approx([9000.0 - 600.0, 9000.0 - 3600.0])


def test_another_robot_begins_a_new_memory():
    memory = filled(3.0)
    memory.append(np.array([0.5]), np.array([[4.0]], np.float32))
    times, values = memory.fine.rows()
    assert times.tolist() == [0.5] and values[0, 0] == 4.0


def test_the_row_at_a_time_is_the_last_one_before_it():
    memory = filled(3.0)
    time, values = memory.row(2.0011)
    assert time == pytest.approx(2.0) and values[0] == pytest.approx(2.0)
    assert memory.row(-1.0) is None
