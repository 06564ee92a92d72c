"""What is reported of a diagnosis, learned tables, signatures, terms of a model and time bases, worked out by hand."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import terms as plant_terms
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR, HIP_MOTOR
from ranger_sim.sysid import (
    answer,
    by_candidates,
    intervals,
    isolability,
    misfit,
    model_terms,
    naming,
    plausibility,
    residual_term,
    results,
)
from ranger_sim.sysid.dataset import Channel, Dataset, Table
from ranger_sim.sysid.diagnosis import Diagnosis, KnownEffect
from ranger_sim.sysid.experiment_models import SAMPLES, Equation
from ranger_sim.sysid.likelihood import Selection
from ranger_sim.sysid.machine import Effect, Known, Recording
from ranger_sim.sysid.machine import Equation as Balance
from ranger_sim.sysid.machines.walk import timebase
from ranger_sim.sysid.model_terms import NoFormError
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.regression import Regression, Whitening

RNG = generator(14, "answers")
N = 400


def named(cause="drag", chi2=50.0, freedom=2, tied=(), at="there", **more):
    effect = Effect(cause, at, "mechanical", ("size",), ({},), lambda r, p, v: {"one": np.ones((N, 1))}, **more)
    return Named(effect, {}, chi2, freedom, 1e-9, 30.0, list(tied), [])


def diagnosis(names=(), p=0.5, after_p=0.5, excess=0.0, forbid=False):
    doubts = SimpleNamespace(forbid=forbid, findings=[])
    look = [misfit.Misfit([misfit.Test("one", "over a", 1.0, 1, each)], each, excess) for each in (p, after_p)]
    return Diagnosis(None, [], None, None, [], [], [], list(names), {}, *look, doubts)


def test_what_is_named_explains_its_part_of_what_repeats():
    two = [named(chi2=50.0, freedom=2), named(chi2=20.0, freedom=3)]
    assert diagnosis(two, excess=35.0).explained == pytest.approx(65.0 / 100.0)
    assert diagnosis().explained == 0.0 and diagnosis(two).explained == 1.0


@pytest.mark.parametrize(
    ("names", "p", "after_p", "excess", "forbid", "detected", "doubtful"),
    [
        ((), 0.5, 0.5, 0.0, False, False, False),
        ((), 0.99e-4, 0.5, 0.0, False, True, True),  # something, and no name
        ((), 1.01e-4, 0.5, 0.0, False, False, False),
        ((named(),), 0.5, 0.5, 0.0, False, True, False),
        ((), 0.5, 0.5, 0.0, True, True, True),
        ((named(),), 0.5, 0.5, 0.0, True, True, True),
        ((named(chi2=52.0),), 1e-9, 1e-5, 21.0, False, True, False),  # 50 of 71 explained
        ((named(chi2=52.0),), 1e-9, 1e-5, 22.0, False, True, True),  # 50 of 72: a name that explains less is none
        ((named(chi2=52.0),), 1e-9, 0.1, 90.0, False, True, False),
    ],
)
def test_something_is_wrong_and_what_it_is_can_be_named_or_not(names, p, after_p, excess, forbid, detected, doubtful):
    found = diagnosis(names, p, after_p, excess, forbid)
    assert (found.detected, found.doubtful) == (detected, doubtful)


def test_a_value_is_reported_with_two_errors_either_way():
    regression = SimpleNamespace(values={"a": 3.0, "b": -1.0}, names=["b", "a"], covariance=np.diag([0.25, 4.0]))
    found = answer._value(regression, "a")
    assert found.value == 3.0 and found.ci95 == pytest.approx((3.0 - 3.92, 3.0 + 3.92))
    assert answer._value(regression, "b").ci95 == pytest.approx((-1.98, -0.02))
    regression.covariance[0, 0] = -1e-18  # rounding
    assert answer._value(regression, "b").ci95 == (-1.0, -1.0)


@pytest.mark.parametrize(("low", "high", "wrong"), [(0.0, 10.0, False), (3.93, 10.0, True), (3.91, 10.0, False),
                                                    (-9.0, 0.07, True), (-9.0, 0.09, False)])  # fmt: skip
def test_a_parameter_is_impossible_with_its_whole_interval_beyond_a_limit(low, high, wrong):
    regression = SimpleNamespace(values={"a": 2.0}, names=["a"], covariance=np.array([[(1.92 / 1.96) ** 2]]))
    machine = SimpleNamespace(parameters=[Known("a", "", 1.0, low, high, ""), Known("z", "", 1.0, 5.0, 6.0, "")])
    found = SimpleNamespace(extended=regression, machine=machine, named=[])
    assert answer._impossible(found) == (["a"] if wrong else [])


def test_what_the_model_had_is_printed_next_to_what_these_data_say():
    had = dataclasses.replace(named(), shape={"n": 1.0})
    was = KnownEffect("drag", "there", {"size": 0.5}, {"n": 1.0})
    regression = SimpleNamespace(
        values={"drag@there:size": 0.7}, names=["drag@there:size"], covariance=np.zeros((1, 1))
    )
    assert results.plain(answer._known(had, was, regression)) == {
        "name": "drag", "at": "there", "shape": {"n": 1.0},
        "parameters": {"size": {"model": 0.5, "value": 0.7, "ci95": [0.7, 0.7]}},
    }  # fmt: skip


def test_the_next_experiment_is_one_in_which_ties_differ():
    def tie(cause):
        return named(cause).effect

    assert answer._next([named("stribeck", tied=[tie("presliding"), tie("stribeck"), tie("drag"), tie("drag")])]) == [
        "slow reversals, far below the speed at which friction has settled",
        "an experiment in which stribeck at there and drag at there differ",
    ]
    assert answer._next([named()]) == []


def plain(response, columns, **more):
    table = Table(0.01 * np.arange(N), {}, (slice(0, N),), "log")
    e = Balance("one", "M", "mechanical", "N", response, columns, np.ones(N, dtype=bool))
    return Recording(table, {}, {"one": e}, **more)


QUIET = SimpleNamespace(whitening={"one": Whitening(np.zeros(0), 0.5)}, shared={})


def test_a_misfit_is_reported_for_all_rows_and_each_regime_of_fifty():
    base, extra, noise = RNG.normal(size=(3, N))
    response = 2.0 * base + 3.0 * extra + 0.5 * noise
    few = np.arange(N) < 57  # 49 of them count: eight at the start do not
    many = np.arange(N) < 58
    one = plain(response, {"p": base}, regimes={"few": few, "many": many})
    before = Regression([one], noise=QUIET)
    louder = SimpleNamespace(whitening={"one": Whitening(np.zeros(0), 2.0)}, shared={})
    after = Regression([one], [{"one": extra[:, None]}], ["x"], noise=louder)
    diagnosed = SimpleNamespace(plain=before, extended=after, recordings=[one], by_candidates=True, named=[named()])
    diagnosed.before = SimpleNamespace(tests=[misfit.Test("one", "over a", 1.0, 1, 1e-9, 0.5)])  # names count instead
    found = answer._channels(diagnosed)
    assert [(each.channel, each.regime) for each in found] == [("one", "all"), ("one", "many")]

    def left(*columns):
        matrix = np.column_stack(columns)[8:]
        return response[8:] - matrix @ np.linalg.lstsq(matrix, response[8:], rcond=None)[0]

    without, with_it = left(base), left(base, extra)
    for told, rows in zip(found, (slice(None), slice(0, 50)), strict=True):
        assert told.rms == pytest.approx(math.sqrt(np.mean(without[rows] ** 2)))
        assert told.noise == pytest.approx(math.sqrt(np.mean(with_it**2)))
        share = 1.0 - np.mean(with_it[rows] ** 2) / np.mean(without[rows] ** 2)
        assert told.repeatable_fraction == pytest.approx(share)


@pytest.mark.parametrize(
    ("p", "features", "repeatable"),
    [(1e-4, "the flexible predictor", 0.36), (0.5, "the flexible predictor", 0.0), (1e-9, "a line at 7 periods", 0.0)],
)
def test_without_a_name_the_noise_is_what_a_predictor_leaves(p, features, repeatable):
    """0.36 of the square can be predicted: 0.8 of the rms is noise. A line's share is that of its neighbours."""
    regression = Regression([plain(RNG.normal(size=N), {"p": np.ones(N)})], noise=QUIET)
    found = SimpleNamespace(plain=regression, extended=regression, recordings=regression.recordings, level=0.01)
    found.by_candidates, found.named = True, []
    found.before = SimpleNamespace(tests=[misfit.Test("one", features, 1.0, 1, p, 0.36)])
    (told,) = answer._channels(found)
    assert told.repeatable_fraction == pytest.approx(repeatable)
    assert told.noise == pytest.approx(math.sqrt(1.0 - repeatable) * told.rms)


def test_letters_and_subsystems_are_those_of_the_equations():
    one = plain(np.zeros(N), {"p": np.zeros(N)})
    assert answer._letters(named(), [one]) == "M"
    assert answer._subsystem(SimpleNamespace(named=[named()], doubtful=False)) == "mechanical"
    found = diagnosis(p=1e-9)
    found.plain = SimpleNamespace(recordings=[one])
    assert answer._subsystem(found) == "mechanical"


# --- shapes between the grid's ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("best", "wanted"), [(1.0, (1.0, 2.0)), (2.0, (1.0, 2.0, 8.0)), (8.0, (2.0, 8.0))])
def test_a_shape_on_a_scale_is_tried_between_the_best_and_its_neighbours(best, wanted):
    grid = [{"s": 8.0}, {"s": 1.0}, {"s": 2.0}]
    effect = dataclasses.replace(named().effect, shapes=grid, scale="s")
    tried = intervals._shapes(dataclasses.replace(named(), effect=effect, shape={"s": best}))
    assert tried[:3] == grid
    more = [each["s"] for each in tried[3:]]
    assert len(more) == 6 * (len(wanted) - 1)
    expected = np.concatenate([np.geomspace(a, b, 8)[1:-1] for a, b in zip(wanted[:-1], wanted[1:], strict=True)])
    assert more == pytest.approx(expected)
    plain_effect = dataclasses.replace(effect, scale=None)
    assert intervals._shapes(dataclasses.replace(named(), effect=plain_effect, shape={"s": best})) == grid


def test_shapes_of_a_large_effect_are_compared_at_one_inflation_and_others_at_their_own():
    """1000000 / 1.00001 is less than 999995: by its inflation alone the first, better shape would be the worse one."""
    assert naming.by_shapes([1e6, 999995.0, 12.0], [1.00001, 1.0, 1.2]) == pytest.approx([1e6, 999995.0, 10.0])
    assert naming.by_shapes([20.0, 30.0], [1.0, 3.0]) == pytest.approx([20.0, 10.0])


def test_a_lag_that_goes_to_and_fro_is_sought_by_a_secant():
    """About each simulated lag the likeliest one is beyond 0.5, by 0.6 of the distance: the third step is at 0.5."""
    tried, simulated = [], 0.4
    for wanted in (0.56, 0.464, 0.5):
        simulated = by_candidates._next(tried, 0.5 - 0.6 * (simulated - 0.5))
        assert simulated == pytest.approx(wanted)


def test_a_lag_that_comes_nearer_from_one_side_is_simulated_at_its_likeliest_shape():
    tried, simulated = [], 0.4
    for wanted in (0.45, 0.475, 0.4875):
        simulated = by_candidates._next(tried, 0.5 + 0.5 * (simulated - 0.5))
        assert simulated == pytest.approx(wanted)


# --- a learned table --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pair", [False, True])
def test_a_learned_table_is_least_squares_over_cells_next_to_the_machine_s_own_columns(pair):
    a, b, base, noise = RNG.normal(size=(4, N))
    response = 2.0 * base + np.where(a > 0.5, 3.0, -1.0) + 0.1 * noise
    one = plain(response, {"p": base, "still": np.zeros(N)})
    machine = SimpleNamespace(generic=lambda r: {"one": {"a": a, "b": b, "t": np.arange(N)}})
    regression = Regression([one], noise=QUIET)
    features = "over a and b" if pair else "over a"
    tests = [misfit.Test("one", "over t", 99.0, 1, 0.0), misfit.Test("one", "history of a", 99.0, 1, 0.0),
             misfit.Test("one", features, 50.0, 3, 1e-9), misfit.Test("one", "over b", 5.0, 3, 1e-3)]  # fmt: skip
    found = residual_term.learn(machine, [one], regression, misfit.Misfit(tests, 0.0, 0.0))
    assert found.over == (("a", "b") if pair else ("a",)) and (found.equation, found.unit) == ("one", "N")
    assert found.low[0] == a.min() and found.high[0] == a.max()
    count = 5 if pair else 10
    assert np.allclose(found.edges[0], np.quantile(a, np.arange(1, count) / count))
    cell = np.searchsorted(found.edges[0], a, side="right")
    if pair:
        cell = 5 * cell + np.searchsorted(found.edges[1], b, side="right")
    assert found.value.shape == ((5, 5) if pair else (10, 1)) == found.error.shape
    columns = np.column_stack((base, np.eye(found.value.size)[cell]))[8:]
    inverse = np.linalg.inv(columns.T @ columns)
    fitted = inverse @ columns.T @ response[8:]
    assert found.value.ravel() == pytest.approx(fitted[1:], abs=1e-4)
    left = response[8:] - columns @ fitted
    rho = max(float(np.mean(left[1:] * left[:-1]) / np.mean(left**2)), 0.0)
    spread = np.mean(left**2) * (1.0 + rho) / (1.0 - rho) * np.diag(inverse)[1:]
    assert found.error.ravel() == pytest.approx(np.sqrt(spread), rel=1e-3)
    column = found.column(machine, one)
    assert column.shape == (N, 1) and column[:, 0] == pytest.approx(found.value.ravel()[cell])
    beyond = SimpleNamespace(generic=lambda r: {"one": {"a": a + 0.5, "b": b}})
    outside = a + 0.5 > a.max()
    assert (
        outside.any() and not np.any(found.column(beyond, one)[outside]) and np.any(found.column(beyond, one)[~outside])
    )
    without, rest = found.left(machine, [one], regression)
    matrix = base[8:, None]
    for told, values in ((without, response[8:]), (rest, response[8:] - column[8:, 0])):
        gone = values - matrix @ np.linalg.lstsq(matrix, values, rcond=None)[0]
        assert told == pytest.approx(math.sqrt(np.mean(gone**2)))
    told = results.plain(found.result((2.0, 1.0)))
    assert told["over"] == list(found.over) and told["domain"][0] == [a.min(), a.max()]
    assert told["value"] == found.value.tolist() and told["deviation"] == found.error.tolist()
    assert told["holdout_rms"] == [2.0, 1.0] and "holdout_rms" not in results.plain(found.result())


def test_nothing_is_learned_where_no_test_over_signals_shows():
    one = plain(RNG.normal(size=N), {"p": RNG.normal(size=N)})
    regression = Regression([one], noise=QUIET)
    for tests in ([], [misfit.Test("one", "over t", 99.0, 1, 0.0)], [misfit.Test("port", "over a", 99.0, 1, 0.0)],
                  [misfit.Test("one", "over a", 9.0, 1, 0.0034)] * 3):  # fmt: skip
        assert residual_term.learn(SimpleNamespace(), [one], regression, misfit.Misfit(tests, 0.0, 0.0)) is None


# --- signatures -------------------------------------------------------------------------------------------------------


def test_signatures_are_what_unknown_signals_and_parameters_leave():
    """Two equations of one unknown, one of them with its derivative: rows at samples, and between them."""
    t = 0.05 * np.arange(SAMPLES)
    c, d = 1.5 + np.sin(t), 2.0 + np.cos(2.0 * t)
    causes = {"x": np.sin(3.0 * t), "y": np.cos(t) ** 2}
    one = Equation("one", "M", (("u", c, 0),), {"p": np.sin(t)}, {"x": causes["x"]}, 0.1)
    two = Equation("two", "M", (("u", d, 1), ("u", 0.3 * np.ones(SAMPLES), 0)), {"p": np.cos(t), "q": t},
                   {"x": 0.5 * causes["x"], "y": causes["y"]}, 0.4)  # fmt: skip
    found = isolability.Signatures([one, two], 0.05)
    mean = 0.5 * (np.eye(SAMPLES)[1:] + np.eye(SAMPLES)[:-1])
    difference = (np.eye(SAMPLES)[1:] - np.eye(SAMPLES)[:-1]) / 0.05
    matrix = np.vstack((np.diag(c) / 0.1, (np.diag(mean @ d) @ difference + 0.3 * mean) / 0.4))

    def column(first, second):
        return np.concatenate((first / 0.1, mean @ second / 0.4))

    def without(vectors, basis):
        q, _ = np.linalg.qr(basis)
        return vectors - q @ (q.T @ vectors)

    none = np.zeros(SAMPLES)
    x, y = column(causes["x"], 0.5 * causes["x"]), column(none, causes["y"])
    behind = {"x": without(x, matrix), "y": without(y, matrix)}
    assert found.raw("x") == pytest.approx(np.linalg.norm(behind["x"]) / np.linalg.norm(x), rel=1e-5)
    tangent = np.column_stack((column(np.sin(t), np.cos(t)), column(none, t)))
    tangent = without(tangent, matrix)
    fitted = {name: without(each, tangent) for name, each in behind.items()}
    for name in ("x", "y"):
        share = np.linalg.norm(fitted[name]) / np.linalg.norm(behind[name])
        assert found.left(name) == pytest.approx(share, rel=1e-4)
    for of, told in ((behind, False), (fitted, True)):
        wanted = abs(of["x"] @ of["y"]) / np.linalg.norm(of["x"]) / np.linalg.norm(of["y"])
        assert found.cosine("x", "y", fitted=told) == pytest.approx(wanted, rel=1e-4)
    assert found.raw("nobody") == 0.0


# --- terms of a model -------------------------------------------------------------------------------------------------

BENCH = SimpleNamespace(name="bench", gear=14.0, motor="hip_motor", parameters=(
    Known("resistance_ohm", "ohm", 1.3, 0.0, 9.0, ""), Known("contact_drop_V", "V", 0.7, 0.0, 9.0, ""),
    Known("torque_constant_Nm_per_A", "N m/A", 0.252, 0.0, 9.0, ""), Known("inertia_kg_m2", "", 1e-4, 0.0, 9.0, ""),
))  # fmt: skip
R = 66.0 / 14.0


@pytest.mark.parametrize(
    ("cause", "numbers", "wanted"),
    [
        ("stribeck", {"excess_Nm": 0.02, "speed_rad_s": 3.0}, {"excess_Nm": 0.02 * R, "speed_rad_s": 3.0 / R}),
        ("coulomb_friction", {"change_Nm": 0.02}, {"change_Nm": 0.02 * R}),
        ("viscous_friction", {"change_Nms": 0.002}, {"change_Nms": 0.002 * R**2}),
        ("direction_friction", {"coulomb_Nm": 0.02}, {"coulomb_Nm": 0.02 * R, "viscous_Nms": 0.0}),
        ("direction_friction", {"viscous_Nms": 0.002}, {"coulomb_Nm": 0.0, "viscous_Nms": 0.002 * R**2}),
        ("drag", {"quadratic_Nms2": 0.001}, {"quadratic_Nms2": 0.001 * R**3}),
        ("cogging", {"cosine_Nm": 0.03, "sine_Nm": 0.04, "periods_per_turn": 4.0},
         {"amplitude_Nm": 0.05 * R, "periods_per_turn": 4.0, "phase_rad": math.atan2(3.0, 4.0)}),
        ("commutation_ripple", {"cosine": -0.03, "sine": 0.04, "periods_per_turn": 7.0},
         {"fraction": 0.05, "periods_per_turn": 7.0, "phase_rad": math.atan2(-3.0, 4.0)}),
        ("resistance_temperature", {"ohm_per_heat": 0.01, "time_constant_s": 0.0}, {"per_K": 0.01 / 1.4}),
        ("resistance_temperature", {"ohm_per_heat": 0.01, "ohm_per_A2": 1.0}, {"per_K": 0.01 / 1.4}),
        ("resistance_temperature", {"ohm_per_heat": 0.01, "time_constant_s": 10.0},
         {"per_K": 0.01 / (1.4**2 * HIP_MOTOR.winding_to_housing_K_per_W)}),
        ("resistance_temperature", {"ohm_per_heat": 0.01, "time_constant_s": 40.0},
         {"per_K": 0.01 / (1.4**2 * HIP_MOTOR.winding_to_housing_K_per_W)}),
        ("torque_constant_temperature", {"per_heat": -5e-4, "time_constant_s": 0.0}, {"per_K": -5e-4 / 0.25}),
        ("contact_drop_change", {"change_V": 0.2, "current_A": 1.0}, {"change_V": 0.2}),
    ],
)  # fmt: skip
def test_an_effect_of_the_bench_is_a_term_at_the_robot_s_joint(cause, numbers, wanted):
    values = {"resistance_ohm": 1.4, "torque_constant_Nm_per_A": 0.25}
    made = model_terms.term_of(BENCH, cause, "hip_motor", numbers, values)
    assert made.pop("at") == "hip_motor" and made.pop("form") == cause
    assert made == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("cause", "at", "numbers", "line"),
    [
        (
            "resistance_temperature",
            "hip_motor",
            {"ohm_per_heat": 0.01, "time_constant_s": 9.9},
            "it heats within 9.9 s",
        ),
        (
            "resistance_temperature",
            "hip_motor",
            {"ohm_per_heat": 0.01, "time_constant_s": 40.1},
            "it heats within 40.1 s",
        ),
        (
            "torque_constant_temperature",
            "hip_motor",
            {"per_heat": 1.0, "time_constant_s": 3.0},
            "follows the current squared",
        ),
        ("battery_sag", "supply", {"per_A": 1.0}, "no form for it"),
        ("cogging", "hip_joint", {"cosine_Nm": 1.0}, "and no place hip_joint"),
        ("drag", "hip_motor", {"cubic": 1.0}, "its coefficients cubic are not those of the form"),
        ("cogging", "hip_motor", {"cosine_Nm": 1.0, "periods_per_turn": 2.0}, "are not those of the form"),
    ],
)
def test_what_the_simulator_cannot_have_says_why(cause, at, numbers, line):
    with pytest.raises(NoFormError, match=line):
        model_terms.term_of(BENCH, cause, at, numbers, {"resistance_ohm": 1.4, "torque_constant_Nm_per_A": 0.25})


def test_other_places_have_no_separate_gear():
    ankle = SimpleNamespace(name="ankle", parameters=())
    assert model_terms.context_of(ankle, "inner_motor", {}).ratio == 1.0
    assert model_terms.context_of(ankle, "inner_motor", {}).motor is ANKLE_MOTOR
    assert model_terms.context_of(BENCH, "hip_motor", {}).ratio == pytest.approx(R)
    assert model_terms.context_of(BENCH, "hip_joint", {}).ratio == 1.0
    play = model_terms.term_of(ankle, "cable_backlash", "inner_cable", {"half_gap_rad": 0.01, "torque_Nm": 0.1}, {})
    assert play == {"form": "cable_backlash", "at": "inner_cable", "gap_rad": 0.01}
    scale = model_terms.term_of(ankle, "sensor_scale", "gyro", {"change": 0.02}, {})
    assert scale["factor"] == pytest.approx(1.02)
    offset = model_terms.term_of(ankle, "sensor_offset", "gyro", {"offset_rad_s": 0.02}, {})
    assert offset["value"] == 0.02


def test_a_motor_s_parameters_become_terms_where_they_surely_differ():
    values = {"resistance_ohm": 1.6, "contact_drop_V": 0.9, "torque_constant_Nm_per_A": 0.3024, "inertia_kg_m2": 5.0}
    sure = {name: (0.99 * value, 1.01 * value) for name, value in values.items()}
    made = {each["form"]: each for each in model_terms.parameter_terms(BENCH, values, sure)}
    assert set(made) == {"resistance_change", "contact_drop_change", "torque_constant_change"}
    assert made["resistance_change"]["change_ohm"] == pytest.approx(0.3)
    assert made["contact_drop_change"]["change_V"] == pytest.approx(0.2)
    assert made["torque_constant_change"]["factor"] == pytest.approx(1.2)
    for value, low, high, there in ((1.6, 1.29, 1.9, False), (1.3064, 1.301, 1.31, False), (1.3066, 1.301, 1.31, True),
                                    (1.0, 0.9, 1.29, True), (1.6, 1.3, 1.9, False)):  # fmt: skip
        found = model_terms.parameter_terms(BENCH, {"resistance_ohm": value}, {"resistance_ohm": (low, high)})
        assert bool(found) is there, value
    assert model_terms.parameter_terms(SimpleNamespace(parameters=BENCH.parameters), values, sure) == []


def test_a_term_of_a_model_is_the_bench_s_effect_again():
    def term(form, **values):
        made = plant_terms.FORMS[form]
        return plant_terms.Term(
            made, "hip_motor", {each.name: values.get(each.name, each.default) for each in made.parameters}
        )

    def back(form, **values):
        return model_terms.effects_of(BENCH, term(form, **values))

    (found,) = back("cogging", amplitude_Nm=0.5, periods_per_turn=4.0, phase_rad=0.3)
    assert found[:2] == ("cogging", "hip_motor") and found[3] == {"periods_per_turn": 4.0}
    assert found[2] == pytest.approx({"cosine_Nm": 0.5 / R * math.sin(0.3), "sine_Nm": 0.5 / R * math.cos(0.3)})
    (found,) = back("commutation_ripple", fraction=0.1, periods_per_turn=7.0, phase_rad=-0.4)
    assert found[2] == pytest.approx({"cosine": 0.1 * math.sin(-0.4), "sine": 0.1 * math.cos(-0.4)})
    (found,) = back("once_per_turn", amplitude_Nm=0.5, periods_per_turn=1.0, phase_rad=0.0)
    assert found[2] == pytest.approx({"cosine_Nm": 0.0, "sine_Nm": 0.5})
    (found,) = back("stribeck", excess_Nm=0.2, speed_rad_s=0.5)
    assert found[2:] == (pytest.approx({"excess_Nm": 0.2 / R}), pytest.approx({"speed_rad_s": 0.5 * R}))
    both = back("direction_friction", coulomb_Nm=0.2, viscous_Nms=0.3)
    assert [each[2] for each in both] == [
        {"coulomb_Nm": pytest.approx(0.2 / R)},
        {"viscous_Nms": pytest.approx(0.3 / R**2)},
    ]
    assert len(back("direction_friction", coulomb_Nm=0.2, viscous_Nms=0.0)) == 1
    (found,) = back("drag", quadratic_Nms2=0.3)
    assert found[2] == pytest.approx({"quadratic_Nms2": 0.3 / R**3})
    (found,) = back("sensor_scale", factor=1.1)
    assert found[2] == pytest.approx({"change": 0.1})
    (found,) = back("sensor_lag", time_constant_s=0.02)
    assert found[2] == {"time_constant_s": 0.02}
    for form in (
        "resistance_change",
        "contact_drop_change",
        "torque_constant_change",
        "coulomb_friction",
        "viscous_friction",
    ):
        assert back(form, **{plant_terms.FORMS[form].parameters[0].name: 0.1}) == []
    with pytest.raises(NoFormError, match="bench does not know spring from a"):
        back("spring", linear_Nm_per_rad=1.0)


# --- time bases -------------------------------------------------------------------------------------------------------


def test_a_held_value_stands_once_more_a_step_before_what_ends_a_silence():
    t = np.array([0.0, 0.1, 0.2, 0.3, 0.6, 0.7])
    stamps, values = timebase._with_holds(Channel("a", "A", t, np.arange(6.0)))
    # two and a half steps are no silence yet
    short = timebase._with_holds(Channel("a", "A", np.array([0.0, 0.1, 0.2, 0.3, 0.549, 0.649]), np.arange(6.0)))[0]
    assert len(short) == 6
    assert stamps == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.5, 0.6, 0.7]) and values.tolist() == [0, 1, 2, 3, 3, 4, 5]


def test_a_silence_is_lost_when_the_channel_moved_over_it():
    t = 0.002 * np.arange(200)
    value = np.where(np.arange(200) % 2, 1.0, 0.0) * 0.01
    even = 0.001 * np.arange(400)
    for gap, moves, lost in ((14, 0.05, True), (14, 0.02, False), (11, 0.05, False)):
        kept = np.ones(200, dtype=bool)
        kept[100 : 100 + gap - 1] = False
        moved = value + moves * (np.arange(200) >= 100)
        moved[99] = moved[100 + gap - 1] = 0.0  # both ends of the silence alike, but for the move
        moved[100 + gap - 1] += moves
        found = timebase._lost(Channel("a", "rad", t[kept], moved[kept]), even)
        # 25 ms are bridged, and five steps; it moved by more than two and a half of its finest steps of 0.01
        inside = (even > t[99]) & (even < t[100 + gap - 1])
        assert np.array_equal(found, inside if lost else np.zeros(400, dtype=bool)), (gap, moves)


def test_a_sample_is_fresh_at_the_nearest_even_stamp():
    even = 1.0 + 0.01 * np.arange(10)
    found = timebase._fresh(np.array([0.98, 0.996, 1.0149, 1.0251, 1.091, 1.2]), even, 0.01)
    assert np.flatnonzero(found).tolist() == [0, 1, 3, 9]


def test_a_time_base_is_the_finest_carrier_s_between_2_and_8_ms():
    def data(step_s, slow_s=0.05):
        fast = Channel(
            "hip_angle_rad", "rad", step_s * np.arange(round(2.0 / step_s)), np.arange(round(2.0 / step_s)) * 1.0
        )
        slow = Channel("hip_current_A", "A", 0.3 + slow_s * np.arange(20), np.arange(20.0))
        state = Channel("walk_state", "1", np.array([0.0, 1.0]), np.array([3.0, 7.0]))
        return Dataset("d", {each.name: each for each in (fast, slow, state)})

    names = ["hip_angle_rad", "hip_current_A", "walk_state"]
    for step_s, base in ((0.004, 0.004), (0.001, 0.002), (0.02, 0.008)):
        table = timebase.even_table(data(step_s), names, ("hip_angle_rad",))
        assert np.diff(table.time_s) == pytest.approx(np.full(len(table) - 1, base))
        assert table.time_s[0] == 0.0 and 2.0 - step_s - base < table.time_s[-1] <= 2.0 - step_s + 1e-9
        assert table["hip_angle_rad"] == pytest.approx(table.time_s / step_s, abs=1e-6)
        assert np.array_equal(table["walk_state"], np.where(table.time_s >= 1.0 - 1e-9, 7.0, 3.0))
        assert "hip_current_A fresh" in table and "hip_angle_rad fresh" not in table
    for slow_s, there in ((0.0121, True), (0.0119, False)):
        table = timebase.even_table(data(0.004, slow_s), names, ("hip_angle_rad",))
        assert ("hip_current_A fresh" in table) is there
    with pytest.raises(UserError, match="d: hip_angle_rad have no time in common"):
        one = Dataset("d", {"hip_angle_rad": Channel("hip_angle_rad", "rad", 0.004 * np.arange(20), np.arange(20.0))})
        timebase.even_table(one, ["hip_angle_rad"], ("hip_angle_rad",))


def test_a_recording_of_which_all_but_moments_are_lost_is_reported():
    t = np.concatenate((0.5 * np.arange(5), 2.0 + 0.004 * np.arange(1, 11)))
    value = np.concatenate((10.0 * np.arange(5), 40.0 + 0.1 * np.arange(1, 11)))
    one = Dataset("d", {"hip_angle_rad": Channel("hip_angle_rad", "rad", t, value)})
    with pytest.raises(UserError, match="d: hip_angle_rad hardly ever arrive at the same time"):
        timebase.even_table(one, ["hip_angle_rad"], ("hip_angle_rad",))


@pytest.mark.parametrize(("rest", "told"), [(0.045, False), (0.055, True)])
def test_a_parameter_is_reported_alone_where_the_others_leave_a_twentieth_of_its_column(rest, told):
    one, two = RNG.normal(size=(2, N))
    one[8:] /= np.linalg.norm(one[8:])
    two[8:] -= one[8:] * (one[8:] @ two[8:])
    two[8:] /= np.linalg.norm(two[8:])
    column = math.sqrt(1.0 - rest**2) * one + rest * two
    regression = Regression([plain(5.0 * one + 3.0 * column + 1e-5 * RNG.normal(size=N), {"p": one, "q": column})])
    found = plausibility._alone(regression, "one", "q")
    assert (found is not None) is told
    if told:
        assert found.value == pytest.approx(3.0, rel=0.02) and found.equation == "one"


# --- names that held-out data take back ------------------------------------------------------------------------------


def judged(ratio95):
    """A judge of held-out data by which causes change the error by a ratio in this interval."""
    error = results.HeldOutError(1.0, sum(ratio95) / 2.0, None, ratio95)
    return SimpleNamespace(errors=lambda named, *_: {"one": error if named else None})


@pytest.mark.parametrize(("ratio95", "stays"), [((0.9, 0.95), True), ((0.99, 1.2), True), ((1.01, 1.2), False)])
def test_a_cause_that_surely_makes_held_out_data_worse_is_refused(ratio95, stays):
    x = RNG.normal(size=N)
    base = Regression([plain(0.5 * x + 0.1 * RNG.normal(size=N), {"p": np.ones(N)})], noise=QUIET)
    effect = Effect("drag", "there", "mechanical", ("size",), ({},), lambda *_: {"one": x[:, None]})
    one = Named(effect, {}, 50.0, 1, 1e-9, 30.0, [], [])
    found = Selection([one], [], base, naming.refit(base, [one]), [], [])
    machine = SimpleNamespace(parameters=[Known("p", "N", 0.0, -1.0, 1.0, "")])
    extended, _ = by_candidates._sure_names(machine, found, [], {}, judged(ratio95), 0)
    assert (found.named, found.refused) == (([one], []) if stays else ([], [one]))
    assert ("drag@there:size" in extended.names) == stays


def test_more_of_what_is_far_above_its_noise_is_not_asked_for():
    """10 s with 5 of 20 independent stretches would be 40 s; what leaves 20 times its noise is not short of data."""
    table = Table(0.01 * np.arange(1000), {}, (slice(0, 1000),), "log")
    floors = {"near": results.NoiseFloor(1.0, 0.9, "N", False), "far": results.NoiseFloor(20.0, 1.0, "N", False)}
    found = SimpleNamespace(detected=False, recordings=[SimpleNamespace(table=table)], floors=floors, errors=None)
    found.stretches = {"near": 5.0, "far": 5.0}
    assert by_candidates._needed_s(found) == {"near": 40}


def test_a_hundredth_of_its_usual_value_beyond_a_limit_is_not_impossible():
    damping = Known("damping", "", 0.04, 0.0, 1.0, "")
    for value, wrong in ((-2e-6, []), (-3.9e-4, []), (-4.1e-4, ["damping"])):
        regression = SimpleNamespace(values={"damping": value}, names=["damping"], covariance=np.array([[1e-20]]))
        found = SimpleNamespace(extended=regression, machine=SimpleNamespace(parameters=[damping]), named=[])
        assert answer._impossible(found) == wrong
