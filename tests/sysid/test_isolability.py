"""What channels can show before any data: known answers, structure against numbers, numbers against plain algebra."""

import itertools
import json

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import causes, channels, isolability
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.experiment_models import MODELS, SAMPLES
from ranger_sim.sysid.isolability import (
    AS_PARAMETER,
    AT_INSTANTS,
    HIDDEN,
    INVISIBLE,
    SHOWN,
    Signatures,
    analyse,
    model_of,
)
from ranger_sim.sysid.machines.motor_bench import MotorBench
from ranger_sim.sysid.structure import overdetermined
from ranger_sim.tools import cli

ELECTRIC = ("voltage_V", "current_A", "speed_rad_per_s")


def test_every_cause_of_the_catalogue_is_in_an_experiment_and_every_channel_is_a_separate_one():
    found = {cause for name in MODELS for cause in model_of(name).causes}
    assert found == set(causes.CAUSES)
    assert set(MODELS) == set(channels.EXPERIMENTS)
    for name in MODELS:
        assert set(model_of(name).channels) <= {each.name for each in channels.experiment(name).channels}


def test_what_the_motor_bench_is_diagnosed_for_is_in_the_catalogue_and_in_its_equations():
    time_s = np.arange(4000) * 0.005
    w = 8.0 * np.sin(1.3 * time_s) * np.sin(0.2 * time_s)
    current = 0.9 * np.sin(0.8 * time_s) + 0.05 * w
    columns = {
        "voltage_V": 1.3 * current + 0.7 * np.sign(current) + 0.252 * w,
        "current_A": current,
        "speed_rad_per_s": w,
        "torque_Nm": 0.252 * current - 0.05 * np.sign(w),
        "temperature_C": 25.0 + 0.1 * time_s,
        "motor_angle_rad": 14.0 * np.cumsum(w) * 0.005,
    }
    bench = MotorBench()
    recording = bench.prepare(Table(time_s, columns, (slice(0, len(time_s)),), "bench"))
    identifiers = {cause.identifier for cause in causes.CAUSES.values()}
    in_equations = {causes.CAUSES[key].identifier for key in model_of("motor-bench").causes}
    diagnosed = {effect.cause for effect in bench.effects([recording])}
    assert diagnosed <= identifiers
    assert diagnosed <= in_equations


def test_a_current_gain_needs_a_load_cell():
    assert analyse("motor-bench", ELECTRIC).status["sensor_scale@current"] == AS_PARAMETER
    assert analyse("motor-bench", (*ELECTRIC, "torque_Nm")).status["sensor_scale@current"] == SHOWN


@pytest.mark.parametrize(
    ("cause", "channel"),
    [
        ("stribeck", "torque_Nm"),
        ("cogging", "torque_Nm"),
        ("drag", "torque_Nm"),
        ("eccentricity", "motor_angle_rad"),
        ("lost_counts", "motor_angle_rad"),
        ("pwm_ripple", "temperature_C"),
    ],
)
def test_the_bench_shows_a_cause_with_the_channel_that_it_needs_and_only_then(cause, channel):
    assert analyse("motor-bench", ELECTRIC).status[cause] == HIDDEN
    assert analyse("motor-bench", (*ELECTRIC, channel)).status[cause] != HIDDEN
    helping = {each.causes: each.channels for each in isolability.advice(analyse("motor-bench", ELECTRIC))}
    assert channel in helping[(cause,)]


def test_the_walk_needs_both_sides_of_a_cable_and_the_voltage_of_a_battery():
    every = model_of("walk").channels
    assert analyse("walk").status["cable_backlash"] == SHOWN
    without = [each for each in every if each not in ("outer_motor_angle_rad", "outer_ankle_current_A")]
    assert analyse("walk", without).status["cable_backlash"] == HIDDEN
    # the motors' power says the battery's current, so that only its voltage is needed
    without = [each for each in every if each != "battery_current_A"]
    assert analyse("walk", without).status["charge_drift"] == SHOWN
    without.remove("battery_voltage_V")
    assert analyse("walk", without).status["charge_drift"] == HIDDEN


def test_a_tie_says_whether_structure_or_only_the_signature_makes_it():
    ties = {(tie.first, tie.second): tie for tie in analyse("motor-bench").ties}
    # both drop a constant voltage against the current while the supply stays the same
    assert ties[("contact_drop_change", "dead_time")].reason == "structure"
    swing = {(tie.first, tie.second): tie for tie in analyse("leg-swing").ties}
    # a wrong zero and lopsided friction are in two equations, and both are a constant torque in small swings
    assert swing[("direction_friction", "sensor_offset@angle")].reason == "signature"
    for tie in (*ties.values(), *swing.values()):
        assert tie.cosine > isolability.TIE


def test_the_worst_pairs_are_as_alike_as_theory_and_an_earlier_study_say():
    equations = equations_of("motor-bench", model_of("motor-bench").channels)
    signatures = Signatures(equations, float(model_of("motor-bench").time_s[1]))
    # a delay and a drift add d and t d; over [0, T] their cosine is (1/2) / sqrt(1/3) for any d whose size stays
    # alike; this motion stands still now and then, which moves it by a few hundredths
    assert signatures.cosine("sensor_lag", "clock_drift") == pytest.approx(3**0.5 / 2, abs=0.05)
    # 0.69 on the motor bench of an earlier study, with another motion
    assert signatures.cosine("drag", "stribeck") == pytest.approx(0.69, abs=0.1)
    # Beside a fitted mu, friction that is larger while the load drives is half of the torque, and so is a wrong gain
    # of the current, but at standstill: the blind cases, which stand still less, have 0.95 and more.
    assert 0.8 < signatures.cosine("load_friction", "sensor_scale@current") < 0.95


def test_more_channels_never_hide_a_cause():
    for first, second in itertools.pairwise([ELECTRIC, (*ELECTRIC, "torque_Nm"), model_of("motor-bench").channels]):
        few, more = analyse("motor-bench", first), analyse("motor-bench", second)
        assert set(few.of(HIDDEN)) >= set(more.of(HIDDEN))
        for cause, told in few.by_structure.items():
            assert told <= more.by_structure[cause]


def equations_of(name, chosen):
    return [each for each in model_of(name).equations if not each.channel or each.channel in chosen]


def subsets(name, count):
    """Channel subsets of an experiment, drawn once and for all."""
    rng = generator(15, f"subsets of {name}")
    every = model_of(name).channels
    return [[each for each in every if rng.random() < 0.6] for _ in range(count)]


@pytest.mark.parametrize("name", ["motor-bench", "leg-swing", "ankle", "positioning"])
def test_what_structure_cannot_show_the_numbers_do_not_show_either(name):
    """Outside the over-determined part unknowns take up any regressor, whatever the coefficients: a theorem that ties
    the graph's code to the linear algebra's, which share none. The other way round holds but for accidents of numbers.
    """
    seen = 0
    for chosen in subsets(name, 12):
        equations = equations_of(name, chosen)
        redundant = overdetermined({each.name: frozenset(term[0] for term in each.terms) for each in equations})
        signatures = Signatures(equations, float(model_of(name).time_s[1]))
        for cause in signatures.columns:
            where = {each.name for each in equations if cause in each.causes}
            if not where & redundant:
                # coefficients that pass through zero leave unknowns nearly free there: 3e-5 was seen
                assert signatures.raw(cause) < AT_INSTANTS, (chosen, cause)
                seen += 1
            elif where <= redundant and all(np.ptp(each.causes[cause]) for each in equations if each.name in where):
                # a constant may be where the motion began, which structure does not know; all else leaves something
                assert signatures.raw(cause) > INVISIBLE, (chosen, cause)
    assert seen


def dense(equations, step_s):
    """(matrix of the unknowns, function of a kind and a name giving its column), by loops over samples."""
    unknowns = sorted({term[0] for each in equations for term in each.terms})
    rows, places = [], []
    for number, equation in enumerate(equations):
        dynamic = any(order for *_, order in equation.terms)
        for k in range(SAMPLES - 1 if dynamic else SAMPLES):
            row = np.zeros((len(unknowns), SAMPLES))
            for unknown, c, order in equation.terms:
                at = row[unknowns.index(unknown)]
                if order:
                    at[k + 1] += 0.5 * (c[k] + c[k + 1]) / step_s
                    at[k] -= 0.5 * (c[k] + c[k + 1]) / step_s
                elif dynamic:
                    at[k] += 0.5 * c[k]
                    at[k + 1] += 0.5 * c[k + 1]
                else:
                    at[k] += c[k]
            rows.append(row.ravel() / equation.sigma)
            places.append((number, k, dynamic))

    def column(kind, name):
        values = []
        for number, k, dynamic in places:
            r = getattr(equations[number], kind).get(name, np.zeros(SAMPLES))
            values.append((0.5 * (r[k] + r[k + 1]) if dynamic else r[k]) / equations[number].sigma)
        return np.array(values)

    return np.array(rows), column


def test_signatures_are_what_plain_least_squares_leave():
    equations = equations_of("leg-swing", ("hip_angle_rad", "current_A", "voltage_V"))
    step_s = float(model_of("leg-swing").time_s[1])
    matrix, column = dense(equations, step_s)
    names = sorted({name for each in equations for name in each.parameters})
    everything = np.column_stack([matrix, *(column("parameters", name) for name in names)])
    some = ["stribeck", "cogging", "sensor_offset@current", "resistance_temperature", "eccentricity"]
    left = {}
    for name in some:
        s = column("causes", name)
        left[name] = s - everything @ np.linalg.lstsq(everything, s, rcond=1e-12)[0]
    signatures = Signatures(equations, step_s)
    for first, second in itertools.combinations(some, 2):
        a, b = left[first], left[second]
        cosine = abs(a @ b) / (np.linalg.norm(a) * np.linalg.norm(b))
        # the ridge of the sparse solution leaves 1e-5 of what should be gone
        assert signatures.cosine(first, second) == pytest.approx(cosine, abs=1e-3)


def told(capsys, *arguments):
    code = cli.main(["causes", *arguments])
    return code, capsys.readouterr()


def test_the_command_prints_the_catalogue_one_cause_and_what_channels_show(capsys):
    code, printed = told(capsys, "--json")
    listed = json.loads(printed.out)
    assert code == 0 and [each["key"] for each in listed] == list(causes.CAUSES)
    assert {"identifier", "number", "meaning"} <= set(listed[0])
    code, printed = told(capsys)
    assert code == 0 and all(key in printed.out for key in causes.CAUSES)
    code, printed = told(capsys, "drag")
    assert code == 0 and "by motor-bench with all its channels: shown" in printed.out
    code, printed = told(capsys, "--experiment", "motor-bench", "--channels", *ELECTRIC)
    assert code == 0 and "Not shown by these channels" in printed.out and "the channel torque_Nm" in printed.out
    code, printed = told(capsys, "--experiment", "motor-bench", "--channels", *ELECTRIC, "--json")
    analysis = json.loads(printed.out)
    assert analysis["channels"] == list(ELECTRIC)
    status = {each["cause"]: each["status"] for each in analysis["causes"]}
    assert status["stribeck"] == HIDDEN and status["resistance_temperature"] == SHOWN
    assert set(status) | set(analysis["not_in_this_experiment"]) == set(causes.CAUSES)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["--experiment", "bench"], "unknown experiment 'bench' (available: motor-bench"),
        (["--experiment", "ankle", "--channels", "torque_Nm"], "ankle: unknown channel 'torque_Nm'"),
        (["--channels", "torque_Nm"], "--channels: of which experiment?"),
        (["ghost"], "unknown cause 'ghost'"),
        (["drag", "--experiment", "ankle"], "either one cause or an experiment"),
    ],
)
def test_a_mistake_on_the_command_line_is_reported_in_one_line(capsys, arguments, line):
    code, printed = told(capsys, *arguments)
    assert code == 2 and line in printed.err and printed.err.count("\n") == 1


def test_a_channel_that_the_experiment_does_not_have_is_reported():
    with pytest.raises(UserError, match="leg-swing: unknown channel 'speed_rad_per_s'"):
        analyse("leg-swing", ["speed_rad_per_s"])
