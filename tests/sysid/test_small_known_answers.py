"""Small functions of the diagnosis on rows that can be worked by hand."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid import gain, misfit, plausibility, signals
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machines.ankle import behind
from ranger_sim.sysid.machines.motor_bench import stand_ins
from ranger_sim.sysid.reading import open_recording as read

# ---- features of a misfit


def test_cells_hold_equally_many_samples_and_equal_values_share_one():
    values = np.array([5.0, 1.0, 3.0, 2.0, 4.0, 6.0])
    assert list(misfit.edges(values, 3)) == pytest.approx([1 + 5 / 3, 1 + 10 / 3])
    assert list(misfit.cells(values, 3)) == [2, 0, 1, 0, 1, 2]
    assert list(misfit.cells(np.array([0.0, 0.0, 0.0, 1.0]), 2)) == [1, 1, 1, 1]
    assert list(misfit.cells(np.arange(10.0), 10)) == list(range(10))


def test_an_indicator_has_a_column_for_each_number_that_occurs():
    found = misfit.indicator(np.array([7, 2, 7, 5]))
    assert np.array_equal(found, [[0, 0, 1], [1, 0, 0], [0, 0, 1], [0, 1, 0]])


def test_features_are_cells_of_each_signal_and_pair_and_slopes_some_samples_back():
    rng = generator(1, "features")
    a, b, t = rng.normal(size=400), rng.normal(size=400), np.linspace(0.0, 9.0, 400)
    found = misfit.features({"a": a, "b": b, "t": t}, (0, 3))
    assert list(found) == [
        "over a", "over b", "over t", "over a and b", "over a and t", "over b and t", "history of a", "history of b",
    ]  # fmt: skip
    assert [found[name].shape for name in ("over a", "over t", "over a and b")] == [(400, 10), (400, 8), (400, 25)]
    assert found["over t"].sum(axis=0) == pytest.approx(np.full(8, 50.0))
    assert np.all(found["over a and b"].sum(axis=1) == 1.0)
    # cells of the pair are those of both: samples in one of them are in one of each
    one = found["over a and b"][:, 7] == 1.0
    assert len(set(misfit.cells(a, 5)[one])) == len(set(misfit.cells(b, 5)[one])) == 1
    slope = np.gradient(a)
    assert np.array_equal(found["history of a"], np.column_stack((slope, np.roll(slope, 3))))


# ---- memory of what is left


def autoregressive(rho, count=200_000):
    noise = generator(3, "memory").normal(size=count)
    out = np.empty(count)
    out[0] = noise[0]
    for k in range(1, count):
        out[k] = rho * out[k - 1] + math.sqrt(1.0 - rho * rho) * noise[k]
    return out


@pytest.mark.parametrize("size", [1.0, 30.0])
def test_the_memory_of_an_autoregression_is_its_coefficient_up_to_0_99(size):
    for rho in (0.5, 0.9):
        # a correlation from 200,000 samples is known to 0.002, or less
        assert plausibility._memory(size * autoregressive(rho)) == pytest.approx(rho, abs=0.006)
    assert plausibility._memory(size * np.ones(1000) * 2.0) == 0.99
    assert plausibility._memory(size * np.array([1.0, -1.0] * 100)) == 0.0
    assert plausibility._memory(np.zeros(10)) == 0.0


class Plain:
    """What `gain` asks of a regression: whether its recordings are white."""

    class Recording:
        def __init__(self, whitened):
            self.whitened = whitened

    def __init__(self, whitened):
        self.recordings = [self.Recording(True), self.Recording(whitened)]


@pytest.mark.parametrize("size", [0.1, 1.0, 30.0])
def test_columns_count_as_often_as_neighbours_are_alike(size):
    """(1 + rho) / (1 - rho), of rho up to 0.95; once in white noise."""
    rest = size * autoregressive(0.8)
    assert gain._memory(Plain(False), rest) == pytest.approx(9.0, rel=0.03)
    assert gain._memory(Plain(False), size * np.ones(1000)) == pytest.approx(39.0)
    assert gain._memory(Plain(True), rest) == 1.0
    assert gain._memory(Plain(False), np.zeros(5)) == gain._memory(Plain(False), rest[:1]) == 1.0


# ---- signs


def test_two_samples_on_either_side_of_a_change_of_sign_do_not_count():
    values = np.array([1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0])
    assert list(stand_ins.one_sign(values)) == [True, True, False, False, False, False, True, True]
    touches = np.array([1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0])  # it does not change
    assert stand_ins.one_sign(touches).all()


def test_the_mean_sign_of_a_straight_line_is_what_it_spends_on_either_side():
    values = np.array([3.0, 1.0, -1.0, -3.0])
    # about the second sample it goes from 2 to 0, about the third from 0 to -2: the signs change in neither
    assert list(stand_ins.mean_sign(values)) == [1.0, 1.0, -1.0, -1.0]
    uneven = np.array([2.0, 1.0, -2.0, -3.0])
    # about the second sample from 1.5 to -0.5: three quarters above
    assert stand_ins.mean_sign(uneven) == pytest.approx([1.0, 0.5, -1.0, -1.0])


def test_samples_near_zero_and_those_within_reach_of_one_do_not_count():
    values = np.array([5.0, 5.0, 5.0, 0.5, 5.0, 5.0, 5.0, 5.0])
    assert list(stand_ins.away(values, 1.0, 0)) == [True] * 3 + [False] + [True] * 4
    assert list(stand_ins.away(values, 1.0, 2)) == [True, False, False, False, False, False, True, True]
    assert list(stand_ins.away(values, 0.5, 0)) == [True] * 8


def test_a_windings_numbers_come_back_from_exact_rows_and_its_current_with_them():
    rng = generator(2, "winding")
    current, speed = rng.uniform(-5.0, 5.0, 300), rng.uniform(-9.0, 9.0, 300)
    current[np.abs(current) < 0.9] = (
        0.3  # below a seventh of the largest: of what does not surely flow nothing is taken
    )
    voltage = 1.5 * current + 0.8 * np.sign(current) + 0.6 * speed
    spoilt = voltage + 50.0 * (np.abs(current) < 0.5)
    assert stand_ins.rough_electrics(spoilt, current, speed) == pytest.approx((1.5, 0.8, 0.6), rel=1e-9)
    assert stand_ins.current_by_voltage(voltage, speed, 1.5, 0.8, 0.6) == pytest.approx(current, abs=1e-12)
    idle = stand_ins.current_by_voltage(0.6 * speed + 0.79, speed, 1.5, 0.8, 0.6)
    assert idle == pytest.approx(np.zeros(300), abs=1e-15)


# ---- filters


def test_filters_work_run_by_run_and_have_the_textbook_s_answers():
    t = 0.01 * np.arange(300)
    table = Table(t, {}, (slice(0, 120), slice(120, 300)))
    line = 2.0 * t + 1.0
    inside = np.r_[20:100, 140:280]
    assert signals.smooth(table, line, 3.0)[inside] == pytest.approx(line[inside], abs=1e-12)
    assert signals.derivative(table, line, 3.0)[inside] == pytest.approx(np.full(len(inside), 2.0), rel=1e-3)
    step = signals.lagged(table, np.ones(300), 0.05)
    for run in table.runs:
        n = np.arange(1, run.stop - run.start + 1)
        assert step[run] == pytest.approx(1.0 - np.exp(-0.01 * n / 0.05), rel=1e-12)
    wide = signals.smooth(table, (np.arange(300) == 60).astype(float), 2.0)
    variance = float(wide @ (np.arange(300) - 60.0) ** 2)
    assert wide.sum() == pytest.approx(1.0) and variance == pytest.approx(4.0, rel=0.01)


def test_an_integral_is_of_trapezoids_and_a_gap_counts_as_a_straight_line():
    t = np.array([1.0, 1.5, 2.0, 5.0])
    found = signals.integral(Table(t, {}, (slice(0, 3), slice(3, 4))), 2.0 * t)
    assert found == pytest.approx(t**2 - 1.0)


def test_uneven_stamps_become_even_run_by_run():
    t = np.concatenate((np.array([0.0, 0.1, 0.21, 0.3, 0.4]), 5.0 + np.array([0.0, 0.1, 0.2, 0.29, 0.4])))
    table = Table(t, {"a": 3.0 * t}, (slice(0, 5), slice(5, 10)), "log", {"a": 0.5})
    found = signals.uniform(table)
    assert found.time_s == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 5.0, 5.1, 5.2, 5.3, 5.4])
    assert found["a"] == pytest.approx(3.0 * found.time_s) and found.runs == (slice(0, 5), slice(5, 10))
    assert (found.name, found.resolution) == ("log", {"a": 0.5})
    assert signals.uniform(found) is found  # the gap between runs is none of its steps


# ---- cells of a file


def test_a_number_with_an_underscore_is_none(tmp_path):
    """Python reads 1_0 as ten, no instrument writes it."""
    path = tmp_path / "log.csv"
    rows = "\n".join(f"{0.1 * n:.1f},{n}" for n in range(30)).replace("1.0,10", "1.0,1_0")
    path.write_text(f"time_s,current_A\n{rows}\n", encoding="utf-8")
    data = read(path)
    (finding,) = [each for each in data.findings if each.kind == "unreadable"]
    assert "'1_0'" in finding.text and "line 12" in finding.text
    assert 10.0 not in data["current_A"].value[np.isfinite(data["current_A"].value)]


# ---- a lag of first order along a motion


@pytest.mark.parametrize("begin_s", [0.0, 7.0])
@pytest.mark.parametrize("columns", [None, 2])
def test_straight_lines_behind_a_lag_have_their_closed_form(begin_s, columns):
    """Of c + s t from rest there: c + s (t - tau (1 - exp(-t / tau))), whatever the stamps begin with."""
    t = 0.002 * np.arange(400)
    run = SimpleNamespace(motion=SimpleNamespace(time_s=begin_s + t))
    lines = 2.0 + 3.0 * t
    values = lines if columns is None else np.column_stack([lines, -lines])
    wanted = 2.0 + 3.0 * (t - 0.05 * (1.0 - np.exp(-t / 0.05)))
    found = behind(values, run, 0.05)
    if columns is None:
        assert found == pytest.approx(wanted, abs=1e-12)
    else:
        assert found == pytest.approx(np.column_stack([wanted, -wanted]), abs=1e-12)
