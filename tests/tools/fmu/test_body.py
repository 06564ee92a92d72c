"""The body behind the interface: the same trajectory as inside, and what it refuses. Without any FMI."""

import json

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import body_files
from ranger_sim.plant.bridge import Bridge
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.tools.fmu.body import NUMBERS, ExportedBody, given_of
from ranger_sim.tools.fmu.units import exponents
from tests.tools.fmu.recording import recorded

SCENARIO = Scenario(seed=3, floor_roughness_m=0.001, slope_rad=0.001, battery_charge=0.9)


def body_of(scenario, **changes):
    made = ExportedBody(json.loads(json.dumps(given_of(scenario))))
    for name, value in changes.items():
        made.set(name.replace("__", "."), value)
    return made


def test_with_the_inputs_of_a_walk_every_output_is_that_of_the_walk_bit_for_bit():
    inputs, outputs, steps = recorded(SCENARIO, 3.0)
    assert steps >= 3 and len(inputs) == 12_000
    assert max(row["hip.delay_s"] for row in inputs) > 0.0  # a slot wrote inside a step
    body = body_of(SCENARIO)
    for number, (row, expected) in enumerate(zip(inputs, outputs, strict=True)):
        for name, value in row.items():
            body.set(name, value)
        assert body.advance(1)
        found = {name: body.get(name) for name in expected}
        assert found == expected, f"step {number}"


def test_every_number_of_the_bodys_table_is_a_parameter_with_its_unit_limits_and_source():
    body = body_of(SCENARIO)
    for key in body_files.keys().values():
        each = body.quantities[f"body.{key.name}"]
        assert each.causality == "parameter" and each.start == body_files.load("ranger").values[key.name]
        assert each.unit == key.metadata["unit"].replace("1", "", 1 if key.metadata["unit"] == "1" else 0)
        assert key.metadata["source"] in each.description and each.limits == key.metadata.get("limits")


def test_the_inputs_start_as_a_bridge_does_at_power_up():
    body = body_of(SCENARIO)
    of_a_motor = {"match_2": 0, "match_6": 0, "period": 600, "delay_s": 0.0, "low_side_2": True, "low_side_6": True}
    of_a_motor |= {"watchdog": False, "watchdog_delay_s": 0.0}
    motors = ("hip", "outer_ankle", "inner_ankle", "steering")
    inputs = {name: each.start for name, each in body.quantities.items() if each.causality == "input"}
    wanted = {f"{motor}.{name}": value for motor in motors for name, value in of_a_motor.items()}
    assert inputs == {**wanted, "imu.mode": 207, "held.now": True}
    drive = body.plant.bridges[0]
    assert (drive.mr2, drive.mr6, drive.mr0, drive.enable2, drive.enable6) == (0, 0, 600, True, True)
    assert body.advance(1) and drive.count == 0  # nothing was written: all is as it was
    assert len([each for each in body.quantities.values() if each.causality == "output"]) == 68
    assert {"sensor.imu_roll_rad", "sensor.imu_rate_x_rad_s", "sensor.hip_absolute"} <= set(body.quantities)


def test_a_bridge_gets_only_what_has_changed():
    reported = []

    class Listed(Bridge):
        def write_pwm(self, *values):
            reported.append(("write_pwm", *values))

        def low_side(self, *values):
            reported.append(("low_side", *values))

        def watchdog_edge(self, *values):
            reported.append(("watchdog_edge", *values))

    body = body_of(SCENARIO)
    body.plant.bridges[:] = [Listed() for _ in range(4)]
    body.set("hip.match_2", 7)
    body.set("hip.delay_s", 3e-6)
    body.advance(2)
    body.set("hip.low_side_6", False)
    body.set("hip.watchdog", True)
    body.set("hip.watchdog_delay_s", -5e-6)
    body.advance(2)
    assert reported == [
        ("write_pwm", 3_000, 7, 0, 600),
        ("low_side", 500_000, True, False),
        ("watchdog_edge", 495_000),
        ("watchdog_edge", 745_000),
    ]
    assert body.plant.imu.mode == 207


def test_many_values_at_once_are_those_one_by_one():
    body, one_by_one = body_of(SCENARIO), body_of(SCENARIO)
    first = 1000  # a reference for the first input: any
    by_kind = {}
    for name, place in body.places.items():
        by_kind.setdefault(body.quantities[name].kind, []).append((name, first + place))
    wanted = {"hip.match_2": 200, "hip.watchdog": True, "hip.delay_s": 2e-6, "held.now": False}
    for name, value in wanted.items():
        one_by_one.set(name, value)
        kind = NUMBERS[body.quantities[name].kind]
        assert body.stepper.set_all([first + body.places[name]], [value], first, kind)
    assert body.advance(40) and one_by_one.advance(40)
    for kind, members in by_kind.items():
        found = body.stepper.get_all([reference for _, reference in members], first, NUMBERS[kind])
        expected = [one_by_one.get(name) for name, _ in members]
        assert found == expected and [type(each) for each in found] == [type(each) for each in expected]


@pytest.mark.parametrize(
    ("names", "values"),
    [
        (["hip.match_2", "outer_ankle.match_2"], [5, -1]),  # beyond its limits
        (["hip.match_2", "imu.mode"], [5, 1]),  # not a mode
        (["hip.match_2", "sensor.hip_absolute"], [5, 1]),  # an output
        (["hip.match_2", "held.now"], [5, 1]),  # of another kind
    ],
)
def test_of_many_values_none_is_set_when_one_cannot_be(names, values):
    body = body_of(SCENARIO)
    references = [body.places[name] for name in names]
    assert not body.stepper.set_all(references, values, 0, NUMBERS["integer"])
    assert not body.stepper.set_all([-1], [5], 0, NUMBERS["integer"])
    assert body.get("hip.match_2") == 0 and body.get("imu.mode") == 207
    assert body.stepper.get_all([0, -1], 0, NUMBERS["integer"]) is None


def test_a_body_that_begins_again_is_as_new():
    body = body_of(SCENARIO)
    body.set("seed", 2**63 - 1)
    body.set("seed", SCENARIO.seed)
    first = dict(body_of(SCENARIO).values)
    body.set("held.now", False)
    assert body.advance(3) and body.steps == 3 and body.steps_in(0.00075, 0.00025, 0.0) == 1
    body.begin()
    assert body.steps == 0 and body.stepper.holding and body.values == {**first, "held.now": False}


def test_a_parameter_acts_and_is_fixed_once_the_body_has_moved():
    heavy = body_of(SCENARIO, body__total_mass_kg=20.0)
    light = body_of(SCENARIO)
    assert heavy.advance(1) and light.advance(1)
    force = heavy.get("state.outer_Fy_N") - light.get("state.outer_Fy_N")
    assert force == pytest.approx((20.0 - 9.91) * 9.81, rel=1e-4)  # held standing on the outer legs
    with pytest.raises(UserError, match="fixed once"):
        heavy.set("body.total_mass_kg", 9.91)


def test_several_steps_at_once_are_those_one_by_one():
    together, alone = body_of(SCENARIO), body_of(SCENARIO)
    for body in (together, alone):
        body.set("hip.match_2", 300)
        body.set("hip.watchdog", True)
        body.set("held.now", False)
    for _ in range(40):
        together.advance(4)
    for _ in range(160):
        alone.advance(1)
    assert together.values == alone.values and together.get("state.hip_A") != 0.0


def test_the_bridge_loses_its_power_when_the_watchdog_line_stays_still():
    body = body_of(SCENARIO)
    body.set("hip.match_2", 300)
    body.set("hip.watchdog", True)
    body.advance(8)
    body.set("hip.watchdog", False)
    body.advance(38)  # the last edge was at 1.75 ms, at the begin of step 7; it is 11.5 ms now
    assert body.plant.bridges[0].powered and body.get("state.hip_A") > 1.0
    body.advance(1)
    assert not body.plant.bridges[0].powered


def test_a_body_that_has_fallen_moves_no_more():
    body = body_of(SCENARIO)
    body.set("held.now", False)
    moved = [body.advance(100) for _ in range(200)]  # 5 s without a motor
    assert moved[0] and not moved[-1] and body.get("state.fell")
    where, steps = body.get("state.hip_x_m"), body.steps
    assert not body.advance(100) and body.steps == steps and body.get("state.hip_x_m") == where


@pytest.mark.parametrize(
    ("time_s", "length_s", "count"),
    [(0.0, 0.00025, 1), (0.0, 0.002, 8), (5e-8, 0.00025 + 5e-8, 1), (0.0, 1.0, 4000)],
)
def test_a_communication_step_is_whole_steps_of_the_plant(time_s, length_s, count):
    assert body_of(SCENARIO).steps_in(time_s, length_s, 0.0) == count
    assert body_of(SCENARIO).steps_in(7.0 + time_s, length_s, 7.0) == count


@pytest.mark.parametrize(
    ("time_s", "length_s", "reported"),
    [
        (0.0, 0.0001, "100 us.*steps of 250 us"),
        (0.0, 0.0003, "300 us"),
        (0.0, 0.0, "0 us"),
        (0.0, -0.00025, "-250 us"),
        (0.001, 0.00025, "from 0.001 s is asked for, the body is at 0 s"),
        (float("nan"), 0.00025, "is asked for"),
        (0.0, float("inf"), "inf us"),
    ],
)
def test_another_step_or_another_time_is_refused(time_s, length_s, reported):
    with pytest.raises(UserError, match=reported):
        body_of(SCENARIO).steps_in(time_s, length_s, 0.0)


@pytest.mark.parametrize(
    ("name", "value", "reported"),
    [
        ("body.total_mass_kg", 0.0, r"body.total_mass_kg is 0.0, allowed are 0.1 to 1000 kg"),
        ("body.total_mass_kg", float("nan"), "nan"),
        ("hip.match_2", -1, "hip.match_2 is -1"),
        ("hip.period", 0, "hip.period is 0"),
        ("hip.delay_s", 0.00025, "hip.delay_s"),
        ("imu.mode", 1, "allowed are 0, 194, 207"),
        ("seed", -1, "seed is -1"),
        ("hip.match_2", 7.5, "hip.match_2 is 7.5, a whole number is expected"),
        ("state.hip_A", 1.0, "state.hip_A is an output"),
    ],
)
def test_a_number_beyond_its_limits_is_refused(name, value, reported):
    with pytest.raises(UserError, match=reported):
        body_of(SCENARIO).set(name, value)


@pytest.mark.parametrize(
    ("name", "value", "reported"),
    [
        ("held.stance", "left", "held.stance is 'left', allowed are 'outer' and 'inner'|outer and inner"),
        ("body.contact", "glue", "contact"),
        ("floor.slope_rad", 2.0, "slope"),
        ("battery.charge", 0.0, "battery_charge"),
    ],
)
def test_parameters_that_make_no_body_are_reported_when_it_begins(name, value, reported):
    body = body_of(SCENARIO)
    body.set(name, value)
    with pytest.raises(UserError, match=reported):
        body.advance(1)


@pytest.mark.parametrize(
    ("unit", "found"),
    [
        ("N m s/rad", ({"kg": 1, "m": 2, "s": -1, "rad": -1}, 1.0)),
        ("kg m^2", ({"kg": 1, "m": 2}, 1.0)),
        ("V", ({"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0)),
        ("ohm", ({"kg": 1, "m": 2, "s": -3, "A": -2}, 1.0)),
        ("m/s^2", ({"m": 1, "s": -2}, 1.0)),
        ("W h", ({"kg": 1, "m": 2, "s": -2}, 3600.0)),
        ("s/m", ({"m": -1, "s": 1}, 1.0)),
        ("1", ({}, 1.0)),
    ],
)
def test_units_are_powers_of_si_base_units(unit, found):
    assert exponents(unit) == found


def test_an_unknown_unit_is_reported():
    with pytest.raises(UserError, match="'furlong'"):
        exponents("m/furlong")
