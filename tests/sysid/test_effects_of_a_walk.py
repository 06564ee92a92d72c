"""What a walking log can show, compared with a second book; strikes, valid rows, and drives and encoders in them."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machines.walk import Walk, causes, machine, strikes
from ranger_sim.sysid.machines.walk.mechanics import Numbers
from ranger_sim.sysid.machines.walk.recording import Rows, WalkRecording, _of_others

NUMBERS = Numbers.of(BodyParameters())
COUNT, STEP_S = 200, 0.01
TIME_S = 2.0 + STEP_S * np.arange(COUNT)
RNG = generator(8, "walk's book")
RATE, CURRENT = RNG.normal(size=COUNT), 3.0 * RNG.normal(size=COUNT)
NO_ROWS = np.arange(0)
M = "mechanical"


def left_by(numbers):
    """Some balance: what it leaves is linear in every number, each with its own slope."""
    fields = [each.name for each in dataclasses.fields(Numbers)]
    return sum((place + 1.0) * getattr(numbers, name) for place, name in enumerate(fields)) * np.ones(COUNT)


def slope_of(*fields):
    names = [each.name for each in dataclasses.fields(Numbers)]
    return -sum(weight * (names.index(name) + 1.0) for name, weight in fields)


def recording(*equations, **columns):
    table = Table(TIME_S, {"outer_leg_angle_rad": RATE} | columns, (slice(0, COUNT),), "walk")
    rows = [Rows(name, "P" if "drive" in name else "M", M, "N m", np.arange(COUNT), left_by) for name in equations]
    made = WalkRecording(table, {"hip_rate": RATE, "hip_current": CURRENT}, dict.fromkeys(equations), rows=rows)
    made.numbers = NUMBERS
    return made


def both(name, sign=1.0):
    return ((name.format("outer"), 1.0), (name.format("inner"), sign))


# cause, place, coefficient: the fields that it changes
BOOK = {
    ("geometry", "feet", "foot_height_m"): both("ankle_offset_{}_m"),
    ("geometry", "outer_feet", "foot_height_m"): (("ankle_offset_outer_m", 1.0),),
    ("geometry", "inner_feet", "foot_height_m"): (("ankle_offset_inner_m", 1.0),),
    ("geometry", "soles", "radius_m"): both("foot_radius_{}_m"),
    ("geometry", "legs", "length_m"): (("leg_length_m", 1.0),),
    ("inertia", "body", "mass_kg"): (("total_mass_kg", 1.0),),
    ("inertia", "legs", "moment_kg_m"): both("mass_moment_{}_kg_m"),
    ("inertia", "legs", "offset_kg_m"): both("mass_offset_{}_kg_m"),
    ("inertia", "legs", "inertia_kg_m2"): both("hip_inertia_{}_kg_m2"),
    ("inertia", "outer_leg", "inertia_kg_m2"): (("hip_inertia_outer_kg_m2", 1.0),),
    ("inertia", "inner_leg", "inertia_kg_m2"): (("hip_inertia_inner_kg_m2", 1.0),),
    ("leg_asymmetry", "legs", "offset_kg_m"): both("mass_offset_{}_kg_m", -1.0),
    ("leg_asymmetry", "legs", "moment_kg_m"): both("mass_moment_{}_kg_m", -1.0),
    ("spring_value", "hip_spring", "stiffness_Nm_per_rad"): (("hip_spring_Nm_per_rad", 1.0),),
    ("spring_value", "cables", "stiffness_Nm_per_rad"): both("cable_{}_Nm_per_rad"),
    ("spring_value", "outer_cable", "stiffness_Nm_per_rad"): (("cable_outer_Nm_per_rad", 1.0),),
    ("spring_value", "inner_cable", "stiffness_Nm_per_rad"): (("cable_inner_Nm_per_rad", 1.0),),
    ("spring_value", "ankle_return", "stiffness_Nm_per_rad"): (("ankle_return_Nm_per_rad", 1.0),),
    ("hip_spring_bend", "hip_spring", "cubic_Nm_per_rad3"): (("hip_spring_cubic_Nm_per_rad3", 1.0),),
    ("contact_loss", "feet", "rolling_Nms"): both("rolling_{}_Nms"),
    ("floor", "floor", "slope_rad"): (("slope_rad", 1.0),),
    ("sensor_offset", "hip_angle_rad", "offset_rad"): (("hip_zero_rad", 1.0),),
    ("sensor_scale", "hip_angle_rad", "change"): (("hip_scale", 1.0),),
    ("sensor_offset", "outer_ankle_angle_rad", "offset_rad"): (("ankle_zero_outer_rad", 1.0),),
    ("sensor_offset", "inner_ankle_angle_rad", "offset_rad"): (("ankle_zero_inner_rad", 1.0),),
    ("sensor_scale", "gyro", "change"): (("leg_scale", 1.0),),
    ("sensor_offset", "outer_leg_angle_rad", "offset_rad"): (("leg_zero_rad", 1.0),),
}


def by_key(found):
    made = {(each.cause, each.at, each.coefficients[0]): each for each in found}
    assert len(made) == len(found)
    return made


def test_numbers_of_body_and_sensors_are_asked_for_one_by_one_and_together():
    one = recording("floor, outer", "hip", "hip drive")
    found = by_key(causes.made([one]))
    hip = {("stribeck", "hip_motor"), ("drag", "hip_motor"), ("load_friction", "hip_motor"),
           ("resistance_temperature", "hip_motor")}  # fmt: skip
    assert [each for each in found if each[:2] not in hip] == list(BOOK)
    for key, fields in BOOK.items():
        columns = found[key].columns(one, {}, {})
        # a drive has nothing of the body's numbers in it
        assert set(columns) == {"floor, outer", "hip"}, key
        for column in columns.values():
            assert column.shape == (COUNT, 1) and np.allclose(column, slope_of(*fields), rtol=1e-6), key


@pytest.mark.parametrize("equation", ["floor, outer", "floor, inner", "hip"])
def test_one_balance_is_enough_for_the_body_s_numbers_and_none_of_a_drive(equation):
    found = causes.made([recording("hip drive"), recording(equation)])
    assert ("geometry", "feet") in {(each.cause, each.at) for each in found}
    assert all(each.cause == "resistance_temperature" for each in causes.made([recording("hip drive", "legs, outer")]))


def test_a_lean_that_was_added_up_has_no_separate_zero():
    added_up = recording("hip")
    del added_up.table.columns["outer_leg_angle_rad"]
    for recordings, there in (([recording("hip")], True), ([recording("hip"), added_up], False)):
        keys = {(each.cause, each.at) for each in causes.made(recordings)}
        assert (("sensor_offset", "outer_leg_angle_rad") in keys) is there


def test_lengths_weights_and_stiffnesses_stay_positive_and_offsets_have_either_sign():
    found = by_key(causes.made([recording("hip")]))
    for key, value in (
        (("inertia", "body", "mass_kg"), NUMBERS.total_mass_kg),
        (("geometry", "legs", "length_m"), NUMBERS.leg_length_m),
        (("spring_value", "cables", "stiffness_Nm_per_rad"), NUMBERS.cable_outer_Nm_per_rad),
        (("sensor_scale", "gyro", "change"), 1.0),
    ):
        admits = found[key].admissible
        assert admits({key[2]: -0.99 * value}) and admits({key[2]: 5.0 * value}), key
        assert not admits({key[2]: -value}) and not admits({key[2]: -1.01 * value}), key
    apart = found["leg_asymmetry", "legs", "moment_kg_m"].admissible
    most = min(NUMBERS.mass_moment_outer_kg_m, NUMBERS.mass_moment_inner_kg_m)
    assert apart({"moment_kg_m": 0.99 * most}) and not apart({"moment_kg_m": 1.01 * NUMBERS.mass_moment_inner_kg_m})
    assert not apart({"moment_kg_m": -1.01 * NUMBERS.mass_moment_outer_kg_m})
    for key in (("leg_asymmetry", "legs", "offset_kg_m"), ("floor", "floor", "slope_rad"),
                ("sensor_offset", "hip_angle_rad", "offset_rad")):  # fmt: skip
        assert all(found[key].admissible({key[2]: size}) for size in (-9.0, 9.0)), key


def test_the_hip_s_motor_has_frictions_next_to_the_base_model():
    one = recording("hip")
    found = by_key(causes.made([one]))
    sign = np.tanh(20.0 * RATE)
    stribeck = found["stribeck", "hip_motor", "excess_Nm"]
    assert [each["speed_rad_s"] for each in stribeck.shapes] == [0.1, 0.2, 0.4, 0.8, 1.6]
    for shape in stribeck.shapes:
        wanted = -sign * np.exp(-np.square(RATE / shape["speed_rad_s"]))
        assert np.allclose(stribeck.columns(one, shape, {})["hip"][:, 0], wanted)
    for key, wanted in (
        (("drag", "hip_motor", "quadratic_Nms2"), -np.sign(RATE) * RATE * RATE),
        (("load_friction", "hip_motor", "per_A"), -abs(CURRENT) * sign),
    ):
        assert np.allclose(found[key].columns(one, {}, {})["hip"][:, 0], wanted)
        assert found[key].columns(recording("floor, outer"), {}, {}) == {}
    for key in (("stribeck", "hip_motor", "excess_Nm"), ("drag", "hip_motor", "quadratic_Nms2")):
        assert found[key].admissible({key[2]: 1e-9}) and not found[key].admissible({key[2]: 0.0})
    assert {each.subsystem for each in found.values() if each.at == "hip_motor"} == {M}


@pytest.mark.parametrize(
    ("leg", "stiffness"), [("outer", "cable_outer_Nm_per_rad"), ("inner", "cable_inner_Nm_per_rad")]
)
def test_a_gap_of_a_cable_is_on_the_side_that_its_load_presses_to(leg, stiffness):
    one = recording(f"{leg} foot")
    one.numbers = dataclasses.replace(NUMBERS, cable_outer_Nm_per_rad=13.0, cable_inner_Nm_per_rad=17.0)
    one.loads = {f"{leg} foot": RATE}
    (play,) = causes.made([one])
    assert (play.cause, play.at, play.subsystem) == ("cable_backlash", f"{leg}_cable", "transmission")
    assert [each["torque_Nm"] for each in play.shapes] == [0.01, 0.03, 0.1]
    for shape in play.shapes:
        wanted = -getattr(one.numbers, stiffness) * np.tanh(RATE / shape["torque_Nm"])
        assert np.allclose(play.columns(one, shape, {})[f"{leg} foot"], wanted[:, None])
    assert play.columns(recording("hip"), {"torque_Nm": 0.1}, {}) == {}
    assert play.admissible({"half_gap_rad": 1e-9}) and not play.admissible({"half_gap_rad": 0.0})


@pytest.mark.parametrize("motor", ["hip", "outer_ankle", "inner_ankle"])
@pytest.mark.parametrize("shown", [("drive",), ("winding",), ("drive", "winding")])
def test_a_winding_that_warms_takes_more_power_and_more_voltage(motor, shown):
    label = motor.replace("_", " ")
    one = recording(*(f"{label} {each}" for each in shown), **{f"{motor}_current_A": CURRENT})
    (warm,) = causes.made([one])
    place = {"hip": "hip_motor", "outer_ankle": "outer_motor", "inner_ankle": "inner_motor"}[motor]
    assert (warm.at, warm.subsystem, warm.coefficients) == (place, "electrical", ("ohm_per_heat",))
    assert [each["time_constant_s"] for each in warm.shapes] == [3.0, 10.0, 30.0, 100.0]
    for shape in warm.shapes:
        heat, keep, state = [], math.exp(-STEP_S / shape["time_constant_s"]), 0.0
        for each in CURRENT:
            state = keep * state + (1.0 - keep) * each * each
            heat.append(state)
        wanted = {"drive": CURRENT**2 * heat, "winding": CURRENT * heat}
        columns = warm.columns(one, shape, {})
        assert set(columns) == {f"{label} {each}" for each in shown}
        assert all(np.allclose(columns[f"{label} {each}"][:, 0], wanted[each]) for each in shown)


def test_a_gyro_s_rate_at_rest_is_a_cause_beyond_what_sound_ones_have():
    for bias, equations, there in (
        (0.021, ("closure",), True),
        (-0.021, ("closure",), True),
        (0.02, ("closure",), False),
        (0.3, ("legs, outer",), False),
    ):
        one = recording(*equations)
        one.gyro_bias_rad_s = bias
        found = [each for each in causes.made([one]) if (each.cause, each.at) == ("sensor_offset", "gyro")]
        assert bool(found) is there
        assert all(np.array_equal(each.columns(one, {}, {})["closure"], np.ones((COUNT, 1))) for each in found)


# --- columns of a wrong number ----------------------------------------------------------------------------------------


def test_a_column_is_that_of_the_other_strides_at_the_same_place():
    one = recording("hip")
    sizes = RNG.uniform(1.0, 2.0, COUNT)
    one.rows[0].left = lambda n: sizes * n.total_mass_kg**2
    alone = one.slope("hip", (("total_mass_kg", 1.0),))
    assert np.allclose(alone, -2.0 * NUMBERS.total_mass_kg * sizes)
    assert one.slope("hip", (("total_mass_kg", 1.0),)) is alone
    one.places, one.seen = np.full(COUNT, -1), {}
    one.places[[3, 50, 90]], one.places[7] = 5, 6
    one.rows[0].where = np.array([3, 7, 50, 90])
    one.rows[0].left = lambda n: sizes[one.rows[0].where] * n.total_mass_kg**2
    found = one.slope("hip", (("total_mass_kg", 1.0),))
    assert np.flatnonzero(found).tolist() == [3, 7, 50, 90]
    own = dict(zip((3, 7, 50, 90), alone[[3, 7, 50, 90]], strict=True))
    wanted = [0.5 * (own[50] + own[90]), own[7], 0.5 * (own[3] + own[90]), 0.5 * (own[3] + own[50])]
    assert np.allclose(found[[3, 7, 50, 90]], wanted)


def test_a_lag_that_grows_has_the_lag_s_column_from_minus_to_plus():
    one = recording("hip")
    lag = one.slope("hip", (("leg_lag_s", 1.0),))
    drift = one.slope("hip", (("leg_lag_drift_s", 1.0),))
    assert np.allclose(drift, lag * (-1.0 + 2.0 * np.arange(COUNT) / (COUNT - 1)))


# --- strikes ----------------------------------------------------------------------------------------------------------


def steps(contact=True, hertz=0.8, split=0.4, seconds=6.0, step_s=0.002):
    """The hip's angle of a walk whose outer foot lands at each trough, and inner at each crest; with its contacts."""
    t = 10.0 + step_s * np.arange(round(seconds / step_s))
    phase = 2.0 * math.pi * hertz * (t - 10.0)
    columns = {"hip_angle_rad": -split * np.cos(phase)}
    if contact:  # a foot stays on the floor for half a stride
        columns |= {"outer_contact": 1.0 * (np.sin(phase) > 0.0), "inner_contact": 1.0 * (np.sin(phase) < 0.0)}
    return Table(t, columns, (slice(0, len(t)),), "steps")


def test_a_contact_shows_a_strike_13_ms_late_while_the_legs_are_apart():
    found = strikes.find(steps())
    # outer feet at 0, 1.25, 2.5 s ..., inner ones between
    times = [each.time_s - 10.0 for each in found]
    assert times == pytest.approx([0.625 * n - 0.013 for n in range(10)], abs=0.0021)
    assert [each.leg for each in found] == [0, 1, 0, 1, 0, 1, 0, 1, 0, 1] and {each.run for each in found} == {0}
    assert strikes.find(steps(split=0.149)) == [] and len(strikes.find(steps(split=0.1501))) > 5
    run = steps()
    bounce = run.columns["outer_contact"].copy()
    bounce[(run.time_s > 11.55) & (run.time_s < 11.57)] = 0.0  # it leaves and comes back while the legs are together
    again = Table(run.time_s, run.columns | {"outer_contact": bounce}, run.runs, "steps")
    assert len(strikes.find(again)) == len(found)


def test_of_short_runs_nothing_is_reported_and_each_run_has_its_own_number():
    run = steps()
    cut = Table(run.time_s, run.columns, (slice(0, 19), slice(19, 1500), slice(1500, 3000)), "cut")
    found = strikes.find(cut)
    assert {each.run for each in found} == {1, 2} and [each.time_s for each in found] == sorted(
        each.time_s for each in found
    )


def test_without_contacts_the_sharpest_jump_of_the_hip_s_rate_in_each_half_swing_is_a_strike():
    """The rate turns by 1 rad/s within a sample, a little after each crest and trough."""
    t = 0.002 * np.arange(3000)
    hip = np.interp(t, 0.625 * np.arange(11) + 0.0007, 0.3 * (-1.0) ** np.arange(11))
    found = strikes.find(Table(t, {"hip_angle_rad": hip}, (slice(0, 3000),), "sharp"))
    inner = [each for each in found if 0.1 < each.time_s < 5.9]
    assert [each.time_s for each in inner] == pytest.approx([0.625 * n for n in range(1, 10)], abs=0.013)
    assert [each.leg for each in inner] == [0 if n % 2 else 1 for n in range(1, 10)]
    small = Table(t, {"hip_angle_rad": 0.49 * hip}, (slice(0, 3000),), "small")
    assert strikes.find(small) == []


def test_a_leg_is_in_stance_between_two_strikes_of_different_legs_that_are_a_step_apart():
    t = 0.01 * np.arange(600)
    table = Table(t, {}, (slice(0, 400), slice(400, 600)), "table")
    touches = [
        strikes.Strike(0.5, 0, 0),
        strikes.Strike(1.1, 1, 0),  # 0.6 s: a step
        strikes.Strike(1.34, 0, 0),  # 0.24 s: none
        strikes.Strike(1.6, 1, 0),  # 0.26 s
        strikes.Strike(2.2, 1, 0),  # the same leg
        strikes.Strike(3.39, 0, 0),  # 1.19 s
        strikes.Strike(4.4, 1, 1),  # another run
        strikes.Strike(5.61, 0, 1),  # 1.21 s
    ]
    stands, single = strikes.standing(table, touches, 0.15, 0.07)
    wanted, alone = np.full(600, -1), np.zeros(600, dtype=bool)
    for start, stop, leg in ((0.5, 1.1, 0), (1.34, 1.6, 0), (2.2, 3.39, 1)):
        first, last = round(100 * start), round(100 * stop)
        wanted[first:last] = leg
        alone[first + 16 : last - 7] = True
    assert np.array_equal(stands, wanted)
    # samples a rounding error off an edge may be on either side
    edges = {round(100 * each.time_s) + k for each in touches for k in (15, 16, -7, -8)}
    inside = np.array([number not in edges for number in range(600)])
    assert np.array_equal(single[inside], alone[inside])


def test_places_are_every_so_long_after_a_strike_and_repeat_from_stride_to_stride():
    t = 0.01 * np.arange(400)
    table = Table(t, {}, (slice(0, 400),), "table")
    touches = [strikes.Strike(0.5 * n + 0.5, n % 2, 0) for n in range(7)]
    stands = np.array([0 if 0.5 + k // 50 * 0.5 >= 0.5 and (k // 50 - 1) % 2 == 0 else 1 for k in range(400)])
    found = strikes.places(table, touches, stands, 0.15, 0.06)
    wanted = np.full(400, -1)
    for n in range(7):
        first, leg = 50 * (n + 1), n % 2
        last = 50 * (n + 2) if n < 6 else 400
        for number, row in enumerate(range(first + 15, 400, 6)):
            if row < last and stands[row] == leg:
                wanted[row] = 2 * number + leg
    assert np.array_equal(found, wanted) and len(np.unique(found)) > 10


# --- rows that count --------------------------------------------------------------------------------------------------


def test_a_mean_of_others_leaves_oneself_out():
    values = np.array([1.0, 2.0, 4.0, 10.0, 7.0])
    found = _of_others(values, np.array([3, 3, 3, 9, -1]))
    assert found.tolist() == [3.0, 2.5, 1.5, 10.0, 7.0]


def test_rows_are_thinned_to_so_long_or_to_places():
    one = recording("hip")
    mask = np.ones(COUNT, dtype=bool)
    mask[3:20] = False
    assert machine._thinned(mask, one).tolist() == [0, *range(20, COUNT, 6)]
    assert machine._thinned(mask, one, 0.5).tolist() == [0, 50, 100, 150]
    one.places = np.where(np.arange(COUNT) % 7 == 0, np.arange(COUNT) // 7, -1)
    assert machine._thinned(mask, one).tolist() == [each for each in range(0, COUNT, 7) if mask[each]]


def test_ends_of_runs_do_not_count():
    table = Table(TIME_S + (np.arange(COUNT) >= 80), {}, (slice(0, 80), slice(80, COUNT)))
    found = machine._inside(table, 0.055)
    assert np.flatnonzero(found).tolist() == [*range(6, 74), *range(86, COUNT - 6)]


def test_a_course_is_smoothed_by_20_ms_and_has_rates_up_to_the_third():
    t = 0.002 * np.arange(2000)
    table = Table(t, {}, (slice(0, 2000),))
    inside = slice(100, -100)
    x, v, a, j = machine._course(table, t**3)
    assert np.allclose(x[inside], (t**3 + 3.0 * t * 0.02**2)[inside], atol=2e-5)
    assert np.allclose(v[inside], 3.0 * (t**2 + 0.02**2)[inside], atol=1e-4)
    assert np.allclose(a[inside], 6.0 * t[inside], atol=1e-4) and np.allclose(j[inside], 6.0, atol=1e-3)
    measured = machine._course(table, t**3, 5.0 * t)
    assert np.array_equal(measured[0], x) and np.allclose(measured[1][inside], 5.0 * t[inside])
    assert np.allclose(measured[2][inside], 5.0) and np.allclose(measured[3][inside], 0.0, atol=1e-6)


def test_single_rows_far_off_are_spikes_as_long_as_they_are_few():
    x = RNG.normal(size=300)
    response = 3.0 * x + 0.7 + 0.01 * RNG.normal(size=300)
    columns = {"hip_gates_W": x, "constant": np.ones(300)}
    assert machine._spikes(response, columns).tolist() == []
    spoilt = response.copy()
    spoilt[[5, 100, 250]] += (1.0, -1.0, 0.09)
    assert machine._spikes(spoilt, columns).tolist() == [5, 100, 250]
    near = response.copy()
    near[40] = 3.0 * x[40] + 0.7 + 0.05  # five deviations
    assert machine._spikes(near, columns).tolist() == []
    many = response.copy()
    many[:24] += 1.0
    assert len(machine._spikes(many, columns)) == 24
    many[24] += 1.0  # more than 8 %
    assert machine._spikes(many, columns).tolist() == []
    # without columns what is far from the middle
    level = 2.0 + 0.01 * RNG.normal(size=100)
    level[7] = 2.5
    assert machine._spikes(level, {}).tolist() == [7]


def test_a_value_that_is_known_before_is_not_bent_to_explain_a_spike():
    """A column that one row alone has: free it explains that row whole, known to be small it leaves it far off."""
    x = np.zeros(200)
    x[30] = 1.0
    noise = 0.01 * RNG.normal(size=200)
    response = noise + 0.5 * x
    assert machine._spikes(response, {"constant": x}).tolist() == []
    assert machine._spikes(response, {"hip_current_lag_s": x}).tolist() == [30]  # known to 5 ms


def test_a_slow_current_is_not_known_about_a_jump_and_across_a_gap():
    t = 0.01 * np.arange(400)
    fresh = (np.arange(400) % 4 == 0).astype(float)  # a sample every 40 ms
    fresh[220:235] = 0.0  # lost for more than 0.1 s: from 216 to 236
    value = np.where(np.arange(400) < 100, 1.0, 1.61)
    value = np.where(np.arange(400) < 300, value, 2.2)  # by 0.59 A: it is followed
    table = Table(t, {"hip_current_A": value, "hip_current_A fresh": fresh}, (slice(0, 400),), "slow")
    current, known = machine._current(table, "hip_current_A")
    off = np.flatnonzero(~known)
    assert off.tolist() == [*range(96 - 3, 100 + 4), *range(216 - 3, 236 + 4)]
    assert current[50] == pytest.approx(1.0) and current[200] == pytest.approx(1.61)
    # a Gaussian of 20 ms: half of a jump between samples 99 and 100
    assert 0.5 * (current[99] + current[100]) == pytest.approx(1.305)
    every = Table(t, {"hip_current_A": value}, (slice(0, 400),), "fast")
    assert machine._current(every, "hip_current_A")[1].all()


def smooth_walk():
    """A second of some motion, all channels of a drive and its encoder; only the rows' algebra is asked."""
    t = 0.002 * np.arange(2000)
    angle, current = 0.3 * np.sin(5.0 * t), 2.0 + 1.5 * np.sin(3.0 * t)
    columns = {
        "hip_angle_rad": angle, "hip_current_A": current, "hip_battery_power_W": 20.0 + np.sin(4.0 * t),
        "hip_voltage_V": 9.0 * np.cos(2.0 * t), "hip_rate_rad_per_s": 2.0 * np.cos(5.0 * t),
    }  # fmt: skip
    return Table(t, columns, (slice(0, 2000),), "drive"), t


def test_a_drive_s_power_a_winding_s_voltage_and_an_encoder_s_rate_have_their_columns():
    table, t = smooth_walk()
    made = WalkRecording(table, {}, {})
    single = np.ones(len(t), dtype=bool)
    rate, current = 1.5 * np.cos(5.0 * t), 2.0 + 1.5 * np.sin(3.0 * t)
    inside = slice(100, -100)
    power, winding = machine._drive_rows(table, single, made)
    assert (power.name, power.letter, power.subsystem, power.unit) == ("hip drive", "P", "supply", "W")
    assert (winding.name, winding.letter, winding.subsystem, winding.unit) == ("hip winding", "E", "electrical", "V")
    wanted = {
        "hip_resistance_ohm": current**2,
        "hip_contact_drop_V": current,
        "hip_generator_constant_Vs_per_rad": current * rate,
        "hip_gates_W": np.ones(len(t)),
        "hip_power_lag_s": -4.0 * np.cos(4.0 * t),
    }
    assert set(power.columns) == set(wanted)
    # under 20 ms a sine of 6 rad/s is smaller by 0.7 %
    for name, column in wanted.items():
        assert np.max(np.abs(power.columns[name] - column)[inside]) < 0.015 * np.max(np.abs(column)), name
    wanted = {
        "hip_resistance_ohm": current,
        "hip_contact_drop_V": np.ones(len(t)),
        "hip_generator_constant_Vs_per_rad": rate,
        "hip_voltage_lag_s": 18.0 * np.sin(2.0 * t),
    }
    assert set(winding.columns) == set(wanted)
    for name, column in wanted.items():
        assert np.max(np.abs(winding.columns[name] - column)[inside]) < 0.015 * np.max(np.abs(column)), name
    for rows, response in ((power, 20.0 + np.sin(4.0 * t)), (winding, 9.0 * np.cos(2.0 * t))):
        assert np.array_equal(np.diff(rows.where), np.full(len(rows.where) - 1, 30))  # three Gaussians apart
        assert np.max(np.abs(rows.left(NUMBERS) - response[rows.where])[5:-5]) < 0.05
    (encoder,) = machine._encoder_rows(table, single, made)
    assert (encoder.name, encoder.letter, encoder.subsystem, encoder.unit) == ("hip encoders", "S", "sensor", "rad/s")
    wanted = {
        "hip_rate_scale": rate, "hip_rate_lag_s": 7.5 * np.sin(5.0 * t), "hip_rate_filter_s2": -37.5 * np.cos(5.0 * t),
    }  # fmt: skip
    assert set(encoder.columns) == set(wanted)
    for name, column in wanted.items():
        assert np.max(np.abs(encoder.columns[name] - column)[inside]) < 0.015 * np.max(np.abs(column)), name
    assert np.max(np.abs(encoder.left(NUMBERS) - 2.0 * np.cos(5.0 * t)[encoder.where])[5:-5]) < 0.02


def test_a_drive_without_its_current_or_angle_and_one_that_is_sampled_too_slowly_have_no_rows():
    table, t = smooth_walk()
    single = np.ones(len(t), dtype=bool)
    for missing in ("hip_current_A", "hip_angle_rad"):
        columns = {name: column for name, column in table.columns.items() if name != missing}
        less = Table(t, columns, table.runs, "less")
        assert machine._drive_rows(less, single, WalkRecording(less, {}, {})) == []
    for every, there in ((19, True), (21, False)):  # of 2 ms: 40 ms are two Gaussians
        fresh = (np.arange(len(t)) % every == 0).astype(float)
        slow = Table(t, table.columns | {"hip_current_A fresh": fresh}, table.runs, "slow")
        assert bool(machine._drive_rows(slow, single, WalkRecording(slow, {}, {}))) is there
    for every, there in ((3, True), (4, False)):  # rates of which fewer than 3 of 10 are new
        fresh = (np.arange(len(t)) % every == 0).astype(float)
        slow = Table(t, table.columns | {"hip_rate_rad_per_s fresh": fresh}, table.runs, "slow")
        assert bool(machine._encoder_rows(slow, single, WalkRecording(slow, {}, {}))) is there


def test_an_equation_counts_at_its_rows_and_keeps_only_numbers_that_it_depends_on():
    one = recording("hip")
    rows = one.rows[0]
    rows.where = np.arange(0, COUNT, 2)
    noise = 0.01 * RNG.normal(size=100)
    noise[10] = 3.0
    rows.left = lambda n: noise + 0.2 * n.leg_zero_rad * np.ones(100)
    rows.base = ("leg_zero_rad", "slope_rad", "motor_zero_outer_rad")
    rows.columns = {"hip_gates_W": CURRENT}
    found = machine._equation(one, rows, NUMBERS)
    # of those known before a column that is nothing goes; others stay, to be told
    assert set(found.columns) == {"leg_zero_rad", "hip_gates_W", "motor_zero_outer_rad"}
    assert np.allclose(found.columns["leg_zero_rad"][::2], -0.2) and not np.any(found.columns["leg_zero_rad"][1::2])
    assert np.allclose(found.response[::2], noise) and not np.any(found.response[1::2])
    assert np.flatnonzero(~found.valid[::2]).tolist() == [10] and not np.any(found.valid[1::2])
    assert (found.name, found.letter, found.subsystem, found.unit, found.few) == ("hip", "M", M, "N m", 60)


def test_what_is_looked_at_without_a_cause_is_the_motion_for_balances_and_time_for_the_rest():
    one = recording("hip", "hip drive")
    one.signals |= {"hip": RATE, "lean": RATE, "t": TIME_S, "hip drive": CURRENT}
    one.equations = {name: SimpleNamespace(letter=letter) for name, letter in (("hip", "M"), ("hip drive", "P"))}
    look = Walk().generic(one)
    assert {name: list(each) for name, each in look.items()} == {
        "hip": ["hip", "lean", "t"],
        "hip drive": ["t", "hip drive"],
    }
    del one.signals["lean"]
    assert list(Walk().generic(one)["hip"]) == ["hip", "t"]
