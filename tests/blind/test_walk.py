"""The walks' generator: the log it makes of a record, how strength is measured, and one walk of the emulated robot."""

import numpy as np
import pytest

from ranger_sim import loading
from ranger_sim.foundation.random_arrays import generator
from tests.blind.generator import walk as walks
from tests.blind.generator.walk import NOMINAL, ROW_S, UNIT, VARIABLES, WALK, Asked, Ruler, apart, basis, log, strides


def record(seed, stride_s=1.2, count=14, bias=0.0):
    """A made-up record: every variable a sine of the stride with some noise; strikes once a stride of each foot."""
    rng = generator(seed, "record")
    times = np.arange(0.0, stride_s * count, 0.002)
    phase = 2.0 * np.pi * times / stride_s
    found = {}
    for i, name in enumerate(VARIABLES):
        found[name] = times, np.sin(phase + i) + bias + 0.05 * rng.standard_normal(len(times))
    for name, start in (("inner_contact", 0.0), ("outer_contact", 0.5)):
        strikes = np.arange(count) * stride_s + start * stride_s
        stamps = np.sort(np.concatenate((strikes, strikes + 0.4 * stride_s)))
        found[name] = np.concatenate(([0.0], stamps + 0.01)), np.arange(len(stamps) + 1) % 2 * 1.0
    return found


def test_a_log_has_rows_of_six_milliseconds_some_of_which_are_lost():
    """Of 30 s about one row in 250 and a silence of 50 to 180 ms every 3.7 s; every value is one that was there."""
    columns = log(generator(1, "log"), record(1, count=26))
    assert list(columns) == ["t_s", *VARIABLES]
    steps = np.round(np.diff(columns["t_s"]) / ROW_S)
    assert np.mean(steps == 1) > 0.98
    silences = steps[steps > 7]
    assert 3 <= len(silences) <= 16 and np.max(silences) <= 0.180 / ROW_S + 8
    assert set(np.round(columns["hip_angle_rad"], 9)) <= set(np.round(record(1, count=26)["hip_angle_rad"][1], 9))


def test_a_value_is_the_latest_that_was_there():
    series = np.array([0.0, 1.0, 2.0]), np.array([5.0, 6.0, 7.0])
    assert walks.latest(series, np.array([-1.0, 0.0, 0.9, 1.0, 9.0])).tolist() == [5.0, 5.0, 5.0, 6.0, 7.0]


def test_strides_are_counted_from_strike_to_strike_when_it_has_settled():
    found = strides(record(2))
    assert found.shape == (9, 16)
    assert found[:, 0] == pytest.approx(1.2, abs=1e-9)
    assert found[:, 1] == pytest.approx(0.6, abs=1.01 * ROW_S)
    with pytest.raises(ValueError, match="only 3 strides"):
        strides(record(2, count=8))


def test_strength_is_what_differs_beyond_chance_and_beyond_the_base_parameters():
    """A difference of known size: 4.85 standard errors in one feature are a strength of 1."""
    rng = generator(3, "features")
    one = rng.standard_normal((10, 16))
    other = one.copy()
    between = np.full(16, 2.0)
    other[:, 5] += UNIT * 2.0  # the error of a difference is sqrt(2 between) = 2
    along = np.zeros((16, 1))
    assert Ruler(between, along).strength(other, one) == pytest.approx(1.0)
    along[5] = 1.0
    assert Ruler(between, along).strength(other, one) == pytest.approx(0.0, abs=1e-9)
    assert apart(other, one, np.zeros(16))[5] == pytest.approx(2.0 * UNIT / np.sqrt(np.var(one[:, 5], ddof=1) * 2 / 10))


def test_what_base_parameters_take_up_is_half_of_the_features_at_most():
    assert basis(generator(4, "columns").standard_normal((16, 12))).shape == (16, 8)
    assert basis(np.ones((16, 3))).shape == (16, 1)


def test_a_plan_has_the_body_s_causes_and_base_parameters_that_are_off_in_every_case():
    cases = WALK.plan(6, 20, ["single", "null"], list(WALK.CAUSES))
    assert {"geometry", "inertia", "spring_value", "sensor_offset"} <= {
        name for case in cases for name, _ in case.effects
    }
    for case in cases:
        WALK.prepare(6, case)
        low, high = (0.2, 0.4) if case.variant == "parameters" else (0.05, 0.15)
        for name, value in case.base.items():
            assert low <= abs(value / NOMINAL[name] - 1.0) <= high
        assert len({asked.seed for asked in case.runs}) == len({asked.battery for asked in case.runs}) == 2


@pytest.mark.parametrize("name", WALK.EFFECTS)
def test_every_effect_changes_what_is_asked_of_the_robot(name):
    effect = WALK.EFFECTS[name]
    asked = Asked(1, 0.8, dict(NOMINAL))
    effect.put(asked, effect.largest, effect.places[0])
    assert (asked.body, asked.terms, asked.options) != (NOMINAL, (), ())
    assert effect.tell(effect.largest, effect.places[0])


def test_a_case_is_two_logs_and_a_truth_whose_strength_is_measured(tmp_path, monkeypatch):
    """On made-up walks, whose hip is tilted by what the effect does to the body's feet: 0.5 of it is many deviations. A
    robot that falls of it is tried again with half of it and other crystals.
    """
    fallen = []

    def made_up(asked, steps):
        tilt = asked.body.get("outer_ankle_offset_m", 0.146) - 0.146
        if abs(tilt) > 0.008 and not fallen:
            fallen.append(asked.seed)
            return None
        return record(asked.seed, bias=100.0 * tilt)

    monkeypatch.setattr(walks, "walk", made_up)
    cases = WALK.plan(9, 2, ["single"], ["geometry"]) + WALK.plan(9, 1, ["null"], ["geometry"])
    cases[0].effects, cases[1].effects, cases[2].number = [("geometry", 4.0)], [("geometry", 0.5)], 2
    made = list(WALK.generate(9, cases, tmp_path))
    assert fallen
    for key, files, holdout, truth in made:
        for name in (*files, *holdout):
            head, *rows = (tmp_path / name).read_text().splitlines()
            assert head == ",".join(("t_s", *VARIABLES))
            assert len(rows) > 2000
        assert files == [f"{key}/a.csv"] and holdout == [f"{key}/b.csv"]
        assert truth["kind"] == ("single" if truth["causes"] else "null")
    strong, weak, null = (truth for _, _, _, truth in made)
    (cause,) = strong["causes"]
    assert cause["strength"] == 4.0 and cause["at"] == "foot_height" and abs(cause["amplitude"]) < 0.008
    assert cause["parameters"]["ankle_offset_m"] == pytest.approx(0.146 + cause["amplitude"])
    assert cause["strength_reached"] > weak["causes"][0]["strength_reached"]
    assert null["causes"] == []


@pytest.mark.skipif(loading.interpreted_is_forced(), reason="a walk is compiled or takes minutes")
def test_the_emulated_robot_walks_with_another_body_and_a_term_and_leaves_what_its_brain_knew():
    asked = Asked(3, 0.8, dict(NOMINAL))
    WALK.EFFECTS["geometry"].put(asked, 0.004, "foot_height")
    WALK.EFFECTS["sensor_offset"].put(asked, 0.01, "hip_absolute")
    found = walks.walk(asked, 8)
    assert set(found) == set(VARIABLES)
    stamps, angle = found["hip_angle_rad"]
    assert stamps[-1] > 3.0 and 0.2 < np.max(angle) < 0.6
    assert np.min(np.diff(np.unique(angle))) > 7e-4  # counts of 8192 a turn
    columns = log(generator(1, "log"), found)
    assert all(np.all(np.isfinite(values)) for values in columns.values())
