"""Inputs that reach the machine late: behind a delay or a low-pass, smooth or held."""

import numpy as np
import pytest
from scipy.signal import lfilter

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.forms import DELAY, FILTER
from ranger_sim.sysid.free_simulation.candidates import given_late, given_slowly
from ranger_sim.sysid.free_simulation.fit import TrajectoryFit
from ranger_sim.sysid.free_simulation.recording import Way
from ranger_sim.sysid.pipeline import diagnose
from tests.sysid.hidden_effects import CASES, SHORT
from tests.sysid.machines_of_a_user import HeatedRod
from tests.sysid.test_input_limits import FINER, Pendulum, STEP_s, swung

FINE = 200  # values in a row's step


def _late(lag_s, finer=STEP_s / FINER):
    """A delay by whole steps of the integration."""
    steps = round(lag_s / finer)
    return lambda given: np.concatenate((np.full(steps, given[0]), given))[: len(given)]


def _slow(lag_s, start=None):
    """A low-pass at `start` when the recording begins, or settled."""
    kept = np.exp(-STEP_s / FINER / lag_s)
    return lambda given: lfilter([1.0 - kept], [1.0, -kept], given, zi=[kept * (given[0] if start is None else start)])[
        0
    ]


def _held(given):
    """Each row's value until the next row."""
    return np.repeat(given[::FINER], FINER)


@pytest.mark.parametrize(
    ("form", "lag_s", "bend"),
    [("delay", 0.033, _late(0.033)), ("filter", 0.08, _slow(0.08)), ("delay", 0.4, _late(0.4))],
    ids=["a delay of three rows", "a low-pass of eight rows", "a delay of forty rows"],
)
def test_a_torque_that_comes_late_is_named_with_its_lag(form, lag_s, bend):
    result = diagnose(Pendulum(), [swung(13, bend)], [swung(14, bend)]).result
    (found,) = result.causes
    assert (found.name, found.at) == ("input_lag", "torque")
    assert set(found.parameters) == {"lag_s", {"delay": "delay_s", "filter": "time_constant_s"}[form]}
    value = found.parameters["lag_s"]
    assert value.ci95[0] <= lag_s <= value.ci95[1]
    assert value.value == pytest.approx(lag_s, rel=0.02)
    assert result.gain.fraction_of_achievable > 0.95


def test_a_low_pass_need_not_have_settled_when_the_recording_begins():
    """It begins at 2 N m, and at less than 1 N m of the torque."""
    bend = _slow(0.5, start=2.0)
    (found,) = diagnose(Pendulum(), [swung(13, bend)], [swung(14, bend)]).result.causes
    assert (found.name, found.at, found.form) == ("input_lag", "torque", "filter")
    value = found.parameters["time_constant_s"]
    assert value.ci95[0] <= 0.5 <= value.ci95[1]
    assert found.parameters["lag_s"].value == pytest.approx(0.5, rel=0.02)


def test_a_voltage_of_before_the_recording_that_arrives_in_it_is_no_further_cause():
    """Its first 40 rows are moved by what was given before it; the offset of a sensor or a jump would be as much."""
    (case,) = (each for each in CASES if each.title == "thrust-stand late")
    (found,) = case.found(1, **SHORT["thrust-stand"]).result.causes
    assert (found.name, found.at, found.form) == ("input_lag", "V", "delay")
    for each in found.parameters.values():
        assert each.ci95[0] <= 0.2 <= each.ci95[1]
        assert each.value == pytest.approx(0.2, rel=0.001)


def _two_runs():
    time_s = np.concatenate((STEP_s * np.arange(50), 3.0 + STEP_s * np.arange(40)))
    given = generator(2, "runs").normal(size=90)
    return Table(time_s, {"u": given}, (slice(0, 50), slice(50, 90)), "two runs"), given


def test_what_a_low_pass_remembers_of_before_a_run_falls_with_its_time_constant():
    table, given = _two_runs()
    late = FILTER.late(table, given, 0.03)
    before = FILTER.before(table, given, late, 0.03)
    usual = np.sqrt(np.mean((late - given) ** 2))
    alone = usual * np.exp(-STEP_s * np.arange(50) / 0.03)
    assert before[:50] == pytest.approx(np.column_stack((alone, np.zeros(50))))
    assert before[50:] == pytest.approx(np.column_stack((np.zeros(40), alone[:40])))


@pytest.mark.parametrize(("lag_s", "rows", "numbers"), [(0.004, 1, 1), (0.03, 3, 3), (0.2, 20, 8)])
def test_a_delay_shows_what_was_before_a_run_for_as_long_as_it_is(lag_s, rows, numbers):
    """Each row has its number, or lies on a straight line between two; in all of them it grows towards the start."""
    table, given = _two_runs()
    before = DELAY.before(table, given, 2.0 + given, lag_s)
    assert before.shape == (90, 2 * numbers)
    assert not np.any(before[rows:50]) and not np.any(before[50 + rows :])
    assert not np.any(before[:50, numbers:]) and not np.any(before[50:, :numbers])
    assert before[:50].sum(axis=1)[:rows] == pytest.approx(2.0 * np.sqrt(1.0 - STEP_s * np.arange(rows) / lag_s))


@pytest.mark.parametrize(("runs", "numbers"), [(4, 8), (10, 4), (50, 1)])
def test_many_runs_have_fewer_numbers_each_for_what_was_before_them(runs, numbers):
    """All together at most 40. Each of a run's rows that show it has a part, and the next run's have none."""
    rows = 30
    time_s = STEP_s * np.arange(rows * runs) + np.repeat(np.arange(runs), rows)
    table = Table(time_s, {}, tuple(slice(rows * k, rows * (k + 1)) for k in range(runs)), "runs")
    given = np.zeros(rows * runs)
    before = DELAY.before(table, given, given + 1.0, 0.2)
    assert before.shape[1] == min(40, runs * numbers)
    reached = np.flatnonzero(before[:, :numbers].sum(axis=1))
    assert reached.tolist() == list(range(20))


def test_a_held_torque_that_comes_late_is_late_by_its_delay_alone():
    """Held values are half a row late on average, which is not the delay's."""

    def bend(given):
        return _late(0.025)(_held(given))

    result = diagnose(Pendulum(), [swung(13, bend)], [swung(14, bend)]).result
    (found,) = result.causes
    assert (found.name, found.at) == ("input_lag", "torque")
    value = found.parameters["lag_s"]
    assert value.ci95[0] <= 0.025 <= value.ci95[1]


@pytest.mark.parametrize("lag_s", [10.0, 60.0])
def test_a_heater_that_comes_late_is_held_and_has_a_half_row_in_its_interval(lag_s):
    """A row is 5 s. Without the lag it looks like a heater that jumps inside of its steps, half a row before."""
    (case,) = (each for each in CASES if each.machine is HeatedRod and (each.cause, each.size) == ("late", lag_s))
    (found,) = case.found(1).result.causes
    assert (found.name, found.at) == ("input_lag", "P")
    value = found.parameters["lag_s"]
    assert value.ci95[0] <= lag_s <= value.ci95[1]
    assert value.value == pytest.approx(lag_s, rel=0.02)


def _steps():
    """(table, given by row) of values that stay for several rows each."""
    levels = generator(1, "held input").uniform(-1.0, 1.0, 12)
    given = np.repeat(levels, 9)
    time_s = STEP_s * np.arange(len(given))
    return Table(time_s, {"u": given}, (slice(0, len(given)),), "steps"), given


def _mean_of_each_step(fine):
    return fine.reshape(-1, FINE).mean(axis=1)


@pytest.mark.parametrize("lag_s", [0.003, 0.01, 0.034])
def test_a_held_input_that_is_late_has_its_mean_over_each_step(lag_s):
    table, given = _steps()
    fine = _late(lag_s, STEP_s / FINE)(np.repeat(given, FINE))
    assert given_late(table, given, lag_s, Way.HELD) == pytest.approx(_mean_of_each_step(fine), abs=1e-9)


@pytest.mark.parametrize("lag_s", [0.003, 0.01, 0.034])
def test_a_held_input_behind_a_low_pass_has_its_mean_over_each_step(lag_s):
    table, given = _steps()
    kept = np.exp(-STEP_s / FINE / lag_s)
    behind, _ = lfilter([0.0, 1.0 - kept], [1.0, -kept], np.repeat(given, FINE), zi=[given[0]])
    # the sum of FINE values is right to half of the change in one of them: 1 / (2 FINE) of a time constant's part
    assert given_slowly(table, given, lag_s, Way.HELD) == pytest.approx(_mean_of_each_step(behind), abs=5e-3)


def test_means_behind_a_low_pass_are_those_of_the_step_that_ends_at_the_row():
    table, given = _steps()
    held = given_slowly(table, given, 0.02, Way.HELD)
    assert given_slowly(table, given, 0.02, Way.MEAN) == pytest.approx(held, abs=1e-12)


def test_a_smooth_input_that_is_late_is_what_it_was_before():
    time_s = STEP_s * np.arange(300)
    table = Table(time_s, {}, (slice(0, 300),), "smooth")
    late = given_late(table, np.sin(5.0 * time_s), 0.0137, Way.CUBIC)
    assert late[5:] == pytest.approx(np.sin(5.0 * (time_s - 0.0137))[5:], abs=1e-5)
    slow = given_slowly(table, np.sin(5.0 * time_s), 0.02, Way.CUBIC)
    phase = np.arctan(5.0 * 0.02)
    # from some time constants on, to the straight lines between rows: (5 * 0.01)^2 / 8
    assert slow[100:] == pytest.approx(np.cos(phase) * np.sin(5.0 * time_s[100:] - phase), abs=4e-4)


class LostPendulum(Pendulum):
    """It gives no numbers with any cause in it."""

    def again(self, *given, **options):
        raise UserError("run: the simulator gives no numbers on this recording")


def test_a_cause_with_which_the_simulator_gives_no_numbers_is_a_finding_without_a_name():
    result = diagnose(LostPendulum(), [swung(13, _slow(0.08))], [swung(14, _slow(0.08))]).result
    assert result.causes == ()
    assert result.detected
    (lost,) = (each for each in result.data_findings if each.kind == "runs_away")
    assert "input_lag" in lost.text and lost.text.endswith("the simulation runs away")


def test_candidates_with_which_the_simulator_runs_away_are_left_out(monkeypatch):
    """The fit without them stays, and other candidates are tried: data are not refused for a candidate's sake."""
    machine = Pendulum()
    recording = machine.prepare(swung(13, _slow(0.08)))
    monkeypatch.setattr(TrajectoryFit, "settle", LostPendulum.again)
    effects = [each for each in machine.effects([recording]) if each.cause == "input_lag"]
    assert machine.about_all(recording, [(each, each.shapes[0]) for each in effects]) is recording


def _lags(machine):
    table = swung(13, lambda given: given)
    recording = machine.prepare(table)
    return {each.cause: each.term.meaning for each in machine.effects([recording]) if each.cause.endswith("_lag")}


class OneOutput(Pendulum):
    outputs = Pendulum.outputs[:1]


class WithoutSensorLag(OneOutput):
    impossible = ("sensor_lag",)


def test_one_output_has_one_lag_which_may_be_of_the_input():
    assert set(_lags(Pendulum())) == {"sensor_lag", "input_lag"}
    assert "inputs" not in _lags(Pendulum())["sensor_lag"]
    one = _lags(OneOutput())
    assert set(one) == {"sensor_lag"} and one["sensor_lag"].endswith("or the inputs are late by as much")
    assert set(_lags(WithoutSensorLag())) == {"input_lag"}
