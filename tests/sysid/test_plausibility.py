"""Fits of data that are not what they say: found by their parameters, and no cause is named from them."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.terms import Model
from ranger_sim.sysid import plausibility
from ranger_sim.sysid.benches.bench_terms import BenchTerms
from ranger_sim.sysid.benches.motor_run import motor_run
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Effect, Known
from ranger_sim.sysid.machines.motor_bench import MotorBench
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.sysid.regression import Regression
from tests.sysid.test_diagnose import SIZE, Cart, cart_run


def changed(**columns):
    run = cart_run(1, drag=0.02)
    return Table(run.time_s, {**run.columns, **columns}, run.runs, "changed")


def kinds(answer):
    return [each["kind"] for each in answer["data_findings"]]


def test_a_sound_run_raises_no_doubt():
    assert kinds(diagnose(Cart(), [cart_run(1, drag=0.02)]).answer) == []


def test_a_sign_turned_round_is_neither_a_machine_nor_a_cause():
    found = diagnose(Cart(), [changed(force_N=-cart_run(1, drag=0.02)["force_N"])]).answer
    assert "impossible" in kinds(found)
    assert found["detected"] and found["abstained"] and found["causes"] == []
    assert found["evidence"]["parameters_are_physical"] is False


def test_a_channel_that_does_not_belong_to_the_others_is_reported():
    noise = generator(3, "another channel").normal(size=SIZE)
    found = diagnose(Cart(), [changed(force_N=noise)]).answer
    assert "unexplained" in kinds(found) and found["abstained"] and found["causes"] == []


def test_a_channel_in_another_unit_is_reported_by_the_parameters():
    """Force in mN under the name of N: a mass of 1.1 t, within no limit of 10 kg; in 0.1 N: 11 kg, reported."""
    force = cart_run(1, drag=0.02)["force_N"]
    assert "impossible" in kinds(diagnose(Cart(), [changed(force_N=1000.0 * force)]).answer)
    found = diagnose(Cart(), [changed(force_N=6.0 * force)]).answer
    (told,) = [each for each in found["data_findings"] if each["channel"] == "mass_kg"]
    assert told["kind"] == "far_off" and told["size"] == pytest.approx(6.6, rel=0.01)
    assert found["causes"]  # told, and no reason to be silent: it may be another machine


@pytest.mark.parametrize(
    ("value", "error", "expected"),
    [
        (-0.4, 0.01, False),  # a little below zero: what the model misses may have done it
        (-0.6, 0.01, True),
        (-0.6, 0.05, False),  # within five standard errors of what may be
        (11.0, 0.1, True),
        (10.4, 0.1, False),
        (1.0, 0.1, False),
    ],
)
def test_absurd_is_what_lies_surely_beyond_the_limits(value, error, expected):
    assert plausibility.absurd(Known("mass", "kg", 1.0, 0.0, 10.0, ""), value, error) is expected


@pytest.fixture(scope="module")
def bench():
    """A sound run of the motor bench."""
    recorded = motor_run(seed=1, seconds=4.0)
    return recorded.table(list(recorded.channels))


def with_factors(table, **factors):
    columns = {name: factors.get(name, 1.0) * column for name, column in table.columns.items()}
    return Table(table.time_s, columns, table.runs, "changed", table.resolution)


def doubts(table):
    machine = MotorBench()
    return plausibility.look(machine, Regression([machine.prepare(table)]))


@pytest.mark.parametrize("channel", ["voltage_V", "speed_rad_per_s"])
@pytest.mark.parametrize("with_angle", [False, True])
def test_a_voltage_or_a_speed_with_its_sign_turned_round_is_not_a_machine(bench, channel, with_angle):
    columns = {name: values for name, values in bench.columns.items() if with_angle or name != "motor_angle_rad"}
    turned = with_factors(Table(bench.time_s, columns, bench.runs), **{channel: -1.0})
    with pytest.raises(UserError, match="opposite signs|not the same motion|the other way round"):
        diagnose(MotorBench(), [turned])


@pytest.mark.parametrize("late", [0, 10])
def test_a_voltage_that_is_late_is_detected_by_an_impossible_inductance_and_given_no_name(bench, late):
    """The column of the inductance is the slope of the current, nearly that of the voltage: it takes the delay."""
    count = len(bench)
    columns = {name: values[late:] for name, values in bench.columns.items()}
    columns["voltage_V"] = bench["voltage_V"][: count - late]
    found = diagnose(MotorBench(), [Table(bench.time_s[late:], columns, (slice(0, count - late),), "late")]).answer
    impossible = [each["channel"] for each in found["data_findings"] if each["kind"] == "impossible"]
    assert ("inductance_H" in impossible) is (late > 0) and found["detected"] is (late > 0) and found["causes"] == []


def test_a_torque_with_its_sign_turned_round_contradicts_the_voltage(bench):
    """The winding says K = 0.25 N m/A and the load cell -0.25: friction and causes could hide it, and are not named."""
    found = diagnose(MotorBench(), [with_factors(bench, torque_Nm=-1.0)]).answer
    (finding,) = [each for each in found["data_findings"] if each["kind"] == "contradiction"]
    assert finding["channel"] == "torque_constant_Nm_per_A" and finding["size"] == pytest.approx(-0.252, rel=0.1)
    assert found["detected"] and found["abstained"] and found["causes"] == []


@pytest.mark.parametrize("channel", ["voltage_V", "current_A", "torque_Nm"])
@pytest.mark.parametrize("order", ["half a second late", "reversed"])
def test_from_a_channel_of_another_time_no_cause_is_named(bench, channel, order):
    """Its equation leaves what is large and as slow as the machine; whitening alone would take that for noise."""
    turned = bench[channel][::-1] if order == "reversed" else np.roll(bench[channel], 250)
    assert doubts(Table(bench.time_s, {**bench.columns, channel: turned}, bench.runs, "changed")).forbid


def test_a_strong_fault_and_loud_sensors_are_no_other_time():
    """Cogging of 20 mN m at the bench's output, and noise of a tenth of the torque."""
    cogging = {"form": "cogging", "at": "hip_motor", "amplitude_Nm": 0.1, "periods_per_turn": 7.0}
    recorded = motor_run(seed=2, terms=BenchTerms(Model([cogging]).terms), seconds=3.0)
    table = recorded.table(list(recorded.channels))
    assert not doubts(table).findings
    noise = generator(4, "loud").normal(size=len(table)) * 0.1 * np.std(table["torque_Nm"])
    assert not doubts(
        Table(table.time_s, {**table.columns, "torque_Nm": table["torque_Nm"] + noise}, table.runs)
    ).forbid


@pytest.mark.parametrize(
    ("factors", "told"),
    [
        ({}, False),
        ({"torque_Nm": 1.3}, False),  # a sensor's scale is a cause
        ({"torque_Nm": 0.1}, True),
        ({"torque_Nm": 10.0}, True),
    ],
)
def test_equations_that_share_a_parameter_contradict_each_other_at_another_sign_or_unit_only(bench, factors, told):
    without = Table(bench.time_s, {n: c for n, c in bench.columns.items() if n != "motor_angle_rad"}, bench.runs)
    found = doubts(with_factors(without, **factors))
    assert ("contradiction" in [each.kind for each in found.findings]) is told
    assert found.forbid or not told


@pytest.mark.parametrize(
    ("factor", "line"),
    [
        (57.3, "0.0174 times as fast as speed_rad_per_s: another gear"),
        (-1.0, "turns the other way round"),
        (1e-3, "turns 99[0-9] times as fast"),
    ],
)
def test_a_speed_in_another_unit_than_the_angle_is_not_a_slipping_pulley(bench, factor, line):
    with pytest.raises(UserError, match=line):
        MotorBench().prepare(with_factors(bench, speed_rad_per_s=factor))


def test_a_speed_that_is_another_motion_than_the_angle_is_reported(bench):
    noise = generator(1, "noise").normal(size=len(bench))
    with pytest.raises(UserError, match="not the same motion"):
        MotorBench().prepare(Table(bench.time_s, {**bench.columns, "speed_rad_per_s": noise}, bench.runs))
    assert np.all(np.isfinite(MotorBench().prepare(bench).signals["w"]))


def of(machine, regression, cause, **coefficients):
    """A cause as named, with these coefficients put into the regression's values."""
    effect = Effect(cause, "force_N", "mechanical", tuple(coefficients), [{}], lambda *_: {})
    made = Named(effect, {}, 100.0, 1, 0.0, 90.0, [], [])
    regression.values |= dict(zip(made.coefficients, coefficients.values(), strict=True))
    return made


def test_a_machine_in_which_everything_is_wrong_is_another_one():
    machine = Cart()
    regression = Regression([machine.prepare(cart_run(1))])
    causes = [of(machine, regression, "drag", quadratic=0.1)] * plausibility.MOST
    assert not plausibility.look(machine, regression, causes[1:]).forbid
    told = plausibility.look(machine, regression, causes)
    assert told.forbid and [each.kind for each in told.findings] == ["too_many"]


@pytest.mark.parametrize("factor", [0.15, 0.3, 3.0, 7.0])
@pytest.mark.parametrize("simulated", [False, True])
def test_far_from_where_its_fit_began_a_simulation_names_nothing(simulated, factor):
    machine = Cart()
    regression = Regression([dataclasses.replace(machine.prepare(cart_run(1)), left_over=simulated)])
    mass = machine.parameters[0]
    machine.parameters = (dataclasses.replace(mass, value=regression.values[mass.name] / factor),)
    told = plausibility.look(machine, regression)
    far = factor in (0.15, 7.0)
    assert told.forbid is (far and simulated)
    found = [each.kind for each in told.findings if each.channel == "mass_kg"]
    assert found == ["other_machine" if told.forbid else "far_off"] * far


@pytest.mark.parametrize(
    ("cause", "coefficients", "doubted"),
    [
        ("sensor_scale", {"change": 0.3}, False),
        ("sensor_scale", {"change": -0.98}, True),  # it shows next to nothing of its quantity
        ("sensor_scale", {"change": 8.85}, True),
        ("sensor_offset", {"offset_N": 0.5}, False),
        ("sensor_offset", {"offset_N": -1e6}, True),
        ("drag", {"quadratic": 1e6}, False),  # not a matter of a sensor
    ],
)
def test_a_scale_or_an_offset_that_no_sensor_has_is_another_signal(cause, coefficients, doubted):
    machine = Cart()
    regression = Regression([machine.prepare(cart_run(1))])
    told = plausibility.look(machine, regression, [of(machine, regression, cause, **coefficients)])
    assert told.forbid is doubted and [each.kind for each in told.findings] == ["other_signal"] * doubted


@pytest.mark.parametrize(
    ("factor", "meant"),
    [
        (1.0, []),
        (8.8507, ["torque_Nm in lbf in"]),
        (1.0 / 9.6, ["speed_rad_per_s in rpm"]),
        (2.0, []),
    ],
)
def test_a_factor_between_two_equations_shows_the_units_that_would_do_it(factor, meant):
    assert plausibility.other_units(MotorBench(), factor) == meant


@pytest.mark.parametrize(("few", "told"), [(20, []), (50, ["few_rows"])])
def test_few_rows_are_reported_below_what_the_machine_says_is_few(few, told):
    recording = Cart().prepare(cart_run(1))
    (name, equation), *_ = recording.equations.items()
    valid = np.zeros_like(equation.valid)
    valid[100 : len(valid) : len(valid) // 25] = True
    recording.equations[name] = dataclasses.replace(equation, valid=valid, few=few)
    found = plausibility.look(Cart(), Regression([dataclasses.replace(recording, whitened=False)])).findings
    assert [each.kind for each in found if each.kind == "few_rows"] == told


def pushed(drag=0.0, cubic=0.0, damping=0.12):
    """A cart's run whose drag goes with the cube of the speed, which the machine's square does not follow."""
    run = cart_run(1)
    v = run["v_m_per_s"]
    return changed(force_N=run["force_N"] + (damping - 0.12) * v + drag * v * np.abs(v) + cubic * v**3)


def test_a_parameter_is_judged_together_with_the_named_cause_that_resembles_it():
    """A cube of the speed is a square less a part that goes with the speed: the damping alone comes out below zero."""
    machine, run = Cart(), pushed(cubic=0.5)
    found = diagnose(machine, [run])
    (named,) = found.named
    alone = found.extended.values["damping"]
    assert named.effect.cause == "drag" and alone < -0.5 and absurd_of(machine, "damping", alone)
    assert "impossible" in [each.kind for each in plausibility.look(machine, found.extended, []).findings]
    assert not plausibility.look(machine, found.extended, found.named).forbid


def test_a_parameter_and_a_cause_that_are_impossible_together_stay_impossible():
    machine, run = Cart(), pushed(drag=-0.05, damping=-0.5)
    found = diagnose(machine, [run])
    assert [each.effect.cause for each in found.named] == ["drag"]
    (finding,) = [each for each in found.doubts.findings if each.kind == "impossible"]
    assert finding.channel == "damping" and "together with what the named causes add" in finding.text


@pytest.mark.parametrize("drag", [0.02, 0.5, 5.0])
def test_what_a_named_cause_adds_is_in_its_parameter_s_unit(drag):
    """Against the straight line through d v |v| over the run's speeds, by numpy's own fit of a polynomial."""
    run = pushed(drag=drag)
    found = diagnose(Cart(), [run])
    v = run["v_m_per_s"]
    (line,) = np.linalg.lstsq(v[:, None], drag * v * np.abs(v), rcond=None)[0]
    shared = plausibility.with_causes(found.extended, Cart.parameters, found.named)
    assert shared.keys() == {"damping"} and shared["damping"] == pytest.approx(line, rel=0.1)


def absurd_of(machine, name, value):
    (known,) = [each for each in machine.parameters if each.name == name]
    return plausibility.absurd(known, value, 0.0)


def test_a_parameter_that_is_a_part_next_to_a_named_cause_is_not_judged_alone():
    """As a spring's stiffness next to its square, which other columns resemble more than the stiffness's does."""
    machine = Cart()
    recording = machine.prepare(cart_run(1))
    regression = Regression([dataclasses.replace(recording, left_over=True, in_part=("mass_kg",))])
    machine.parameters = (dataclasses.replace(machine.parameters[0], value=0.1), machine.parameters[1])
    (cause,) = [of(machine, regression, "drag", quadratic=0.1)]
    assert not plausibility.look(machine, regression, [cause]).findings
    (alone,) = plausibility.look(machine, regression).findings
    assert (alone.channel, alone.kind) == ("mass_kg", "other_machine")


@pytest.mark.parametrize(
    ("value", "error", "sure"),
    [
        (-0.4, 0.1, 3.9),  # below zero, and by less than half of what it usually is; a hundredth of that is nothing
        (-0.4, 0.01, 39.0),
        (0.3, 0.1, 0.0),
        (-0.9, 0.05, 0.0),  # so far that no cause is named at all
        (12.0, 1.0, 1.99),
    ],
)
def test_how_surely_a_parameter_is_beyond_its_limits_is_in_standard_errors(value, error, sure):
    weight = Known("weight", "N m", 1.0, 0.0, 10.0, "")
    regression = SimpleNamespace(names=["weight"], values={"weight": value}, covariance=np.array([[error**2]]))
    regression.recordings = []
    assert plausibility.surest_beyond([weight], regression, []) == pytest.approx(sure)
