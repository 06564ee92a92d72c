"""What a diagnosis writes is what simulators and diagnoses read: terms at the robot's joint, effects as measured."""

import json
import math
import tomllib

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import terms
from ranger_sim.plant.electrics.electrics import Electrics
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.sysid import model_file
from ranger_sim.sysid.benches.bench_terms import BenchTerms
from ranger_sim.sysid.benches.motor import BENCH_MOTOR, SuppliedMotor
from ranger_sim.sysid.benches.motor_run import error, motor_run
from ranger_sim.sysid.machines.ankle import Ankle
from ranger_sim.sysid.machines.motor_bench import MotorBench
from ranger_sim.sysid.model_terms import NoFormError, effects_of, term_of
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.tools.cli import main

BENCH = MotorBench()
R = BodyParameters().hip_gear / BENCH.gear
VALUES = {"resistance_ohm": 1.5, "torque_constant_Nm_per_A": 0.25}


def hidden(**table):
    return BenchTerms(terms.Model([{"at": "hip_motor", **table}]).terms)


@pytest.mark.parametrize(
    ("cause", "numbers", "torque"),
    [
        ("drag", {"quadratic_Nms2": 2e-4}, lambda a, w: -2e-4 * w * abs(w)),
        ("stribeck", {"excess_Nm": 0.03, "speed_rad_s": 2.0}, lambda a, w: -0.03 * math.exp(-((w / 2.0) ** 2))),
        ("direction_friction", {"viscous_Nms": 0.001}, lambda a, w: -0.001 * abs(w)),
        ("direction_friction", {"coulomb_Nm": 0.01}, lambda a, w: -0.01),
        (
            "cogging",
            {"cosine_Nm": 0.02, "sine_Nm": -0.01, "periods_per_turn": 7.0},
            lambda a, w: 0.02 * math.cos(7.0 * BENCH.gear * a) - 0.01 * math.sin(7.0 * BENCH.gear * a),
        ),
    ],
)
def test_a_torque_of_the_rotor_is_the_same_work_at_either_gear(cause, numbers, torque):
    """A rotor that turns by 1 has turned the bench by 1/14 and the joint by 1/66, and loses the same energy."""
    table = term_of(BENCH, cause, "hip_motor", numbers, VALUES)
    on = BenchTerms(terms.Model([table]).terms)
    for angle, rate in ((0.3, 1.5), (1.1, 3.0)):
        at_bench = torque(angle, rate)
        at_joint = on.torque_Nm("hip_motor", angle / R, rate / R)
        # the simulator's sign is tanh(rate / 0.05 rad/s): 1 - 6e-6 at the slowest of these
        assert at_joint / R == pytest.approx(at_bench, rel=1e-5)
        assert on.output_Nm(angle, rate, BENCH.gear) == pytest.approx(at_joint / R, rel=1e-12)


def test_electrical_effects_become_terms_of_the_winding():
    of = lambda cause, **numbers: term_of(BENCH, cause, "hip_motor", numbers, VALUES)  # noqa: E731
    assert of("resistance_temperature", ohm_per_heat=0.006, time_constant_s=0.0)["per_K"] == pytest.approx(0.004)
    # I^2 R heats the winding by 2 K/W above its housing: 0.018 ohm per A^2 / (1.5 ohm x 1.5 ohm x 2 K/W)
    assert of("resistance_temperature", ohm_per_heat=0.018, time_constant_s=30.0)["per_K"] == pytest.approx(0.004)
    assert of("torque_constant_temperature", per_heat=-0.0005, time_constant_s=0.0)["per_K"] == pytest.approx(-0.002)
    assert of("contact_drop_change", change_V=0.2, current_A=0.3) == {
        "form": "contact_drop_change",
        "at": "hip_motor",
        "change_V": 0.2,
    }
    ripple = of("commutation_ripple", cosine=0.03, sine=0.04, periods_per_turn=11.0)
    assert ripple["fraction"] == pytest.approx(0.05) and ripple["phase_rad"] == pytest.approx(math.atan2(3.0, 4.0))


def test_springs_and_gaps_are_terms_under_the_forms_name():
    table = term_of(BENCH, "return_spring", "inner_ankle", {"cubic_Nm_per_rad3": 0.03}, VALUES)
    assert table == {"form": "spring", "at": "inner_ankle", "cubic_Nm_per_rad3": 0.03}
    table = term_of(BENCH, "cable_backlash", "inner_cable", {"half_gap_rad": 0.01, "torque_Nm": 0.03}, VALUES)
    assert table == {"form": "cable_backlash", "at": "inner_cable", "gap_rad": 0.01}


def test_a_spring_with_square_and_cube_is_a_term_with_the_base_s_change_in_it():
    """The torque of term and simulator's spring, against the fitted spring's, angle by angle."""
    numbers = {"square_Nm_per_rad2": 0.75, "cubic_Nm_per_rad3": 0.31, "rest_rad": 1.66}
    fitted = {"return_stiffness_Nm_per_rad": 0.72, "return_torque_Nm": -0.23}
    term = term_of(Ankle(), "return_spring", "inner_ankle", numbers, fitted)
    for angle in (0.4, 1.0, 1.66, 2.2):
        x = angle - 1.66
        wanted = -0.72 * x - 0.23 - 0.75 * x**2 - 0.31 * x**3
        y = angle - term["rest_rad"]
        pulls = term["linear_Nm_per_rad"] * y + term["square_Nm_per_rad2"] * y**2 + term["cubic_Nm_per_rad3"] * y**3
        assert -0.066 * x - pulls == pytest.approx(wanted, abs=1e-12)
    with pytest.raises(NoFormError, match="it pulls at every angle"):
        numbers["cubic_Nm_per_rad3"] = 0.0
        term_of(Ankle(), "return_spring", "inner_ankle", numbers, fitted)


@pytest.mark.parametrize(
    ("cause", "at", "numbers", "reason"),
    [
        ("presliding", "hip_motor", {"friction_Nm": 0.1, "slide_rad": 0.01}, "no form for it"),
        ("sensor_offset", "torque_Nm", {"offset_Nm": 0.1}, "no place torque_Nm"),
        ("resistance_temperature", "hip_motor", {"ohm_per_heat": 0.1, "time_constant_s": 300.0}, "heats within 300 s"),
        ("drag", "hip_motor", {"quadratic_Nms2": -1.0}, "allowed are 0 to 10"),
        ("drag", "hip_motor", {"other": 1.0}, "not those of the form"),
    ],
)
def test_what_has_no_form_says_why(cause, at, numbers, reason):
    with pytest.raises(NoFormError, match=reason):
        term_of(BENCH, cause, at, numbers, VALUES)


@pytest.mark.parametrize(
    ("cause", "numbers"),
    [
        ("cogging", {"cosine_Nm": 0.02, "sine_Nm": -0.01, "periods_per_turn": 7.0}),
        ("commutation_ripple", {"cosine": -0.03, "sine": 0.04, "periods_per_turn": 11.0}),
        ("stribeck", {"excess_Nm": 0.03, "speed_rad_s": 2.0}),
        ("direction_friction", {"viscous_Nms": 0.001}),
        ("drag", {"quadratic_Nms2": 2e-4}),
    ],
)
def test_a_term_is_the_effect_that_it_was_made_of(cause, numbers):
    (term,) = terms.Model([term_of(BENCH, cause, "hip_motor", numbers, VALUES)]).terms
    ((name, at, coefficients, shape),) = effects_of(BENCH, term)
    assert (name, at) == (cause, "hip_motor")
    assert {**coefficients, **shape} == pytest.approx(numbers)


def test_a_torque_constant_that_was_changed_stays_so_when_the_motor_warms():
    electrics = Electrics(None, 1)

    class Plant:
        pass

    plant = Plant()
    plant.electrics = electrics
    tables = [
        {"form": "torque_constant_change", "at": "hip_motor", "factor": 0.9},
        {"form": "torque_constant_temperature", "at": "hip_motor", "per_K": -0.002},
    ]
    terms.Model(tables).apply(plant)
    assert electrics.hip.K == pytest.approx(0.9 * 0.018)
    electrics.hip.housing_temperature_C = 35.0
    electrics.hip._warm(0.0)
    assert electrics.hip.K == pytest.approx(0.9 * 0.018 * (1.0 - 0.02))
    assert electrics.outer_ankle.K == pytest.approx(0.018)


# --- there and back ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cogging(tmp_path_factory):
    """(hidden terms, the recording, its diagnosis, the model file) of an emulated bench whose rotor cogs."""
    truth = hidden(form="cogging", amplitude_Nm=0.02 * R, periods_per_turn=7.0, phase_rad=0.7)
    recorded = motor_run(seed=1, terms=truth, seconds=6.0)
    found = diagnose(BENCH, [recorded.table(list(recorded.channels))])
    path = tmp_path_factory.mktemp("model") / "extended.toml"
    path.write_text(found.result.extended_model, encoding="utf-8")
    return truth, recorded, found, path


def test_a_term_hidden_in_the_emulated_bench_is_found_and_the_benchs_error_falls_with_the_file(cogging):
    _, _, found, path = cogging
    (term,) = tomllib.loads(path.read_text(encoding="utf-8"))["term"]
    assert (term["form"], term["at"], term["periods_per_turn"]) == ("cogging", "hip_motor", 7.0)
    assert term["amplitude_Nm"] == pytest.approx(0.02 * R, rel=0.05)
    assert term["phase_rad"] == pytest.approx(0.7, abs=0.05)
    read = model_file.read(path, BENCH)
    other = motor_run(seed=2, terms=cogging[0], seconds=3.0)  # another course of voltage and brake
    before = error(other, BENCH_MOTOR, 2, BenchTerms())
    after = error(other, BENCH_MOTOR, 2, BenchTerms(read.model.terms, read.parameters))
    # what is left are the instruments, 2 mN m of the load cell and 0.03 rad/s of the speed, and at 4 s the angle that
    # a slightly different friction has come to: the cogging's phase follows it
    assert after["torque_Nm"] < 0.003 and before["torque_Nm"] > 4.0 * after["torque_Nm"]
    assert after["speed_rad_per_s"] < 0.033 < 0.04 < before["speed_rad_per_s"]
    assert found.answer["causes"][0]["name"] == "cogging"
    assert found.answer["causes"][0]["evidence"]["predicted"] == {"status": "shown", "ties": []}


def test_a_second_diagnosis_that_starts_from_the_file_finds_nothing_more(cogging):
    _, recorded, _, path = cogging
    read = model_file.read(path, BENCH)
    again = diagnose(BENCH, [recorded.table(list(recorded.channels))], known=read.effects)
    assert not again.answer["detected"]
    assert again.answer["evidence"]["known"][0]["name"] == "cogging"
    # and its own file has the effect still
    assert 'form = "cogging"' in again.result.extended_model


def test_the_walk_runs_with_the_written_file(cogging, tmp_path, capsys):
    path = cogging[3]
    out = tmp_path / "walk.json"
    assert main(["walk", "--time", "0.02s", "--model", str(path), "--json", str(out)]) == 0
    assert str(path) in out.read_text(encoding="utf-8")


def test_what_cannot_be_simulated_is_refused_or_left_out_by_the_user_and_reported(cogging, tmp_path, capsys):
    text = cogging[3].read_text(encoding="utf-8") + (
        '\n[[diagnosis.effect]]\ncause = "presliding"\nat = "hip_motor"\nno_form = "there is none"\n'
        "left_out = false\ncoefficients = { friction_Nm = 0.1 }\nshape = { slide_rad = 0.01 }\n"
    )
    path = tmp_path / "more.toml"
    path.write_text(text, encoding="utf-8")
    assert main(["walk", "--time", "0.01s", "--model", str(path)]) == 2
    said = capsys.readouterr().err
    assert "presliding at hip_motor cannot be simulated: there is none; with left_out = true" in said
    assert said.count("\n") == 1
    path.write_text(text.replace("left_out = false", "left_out = true"), encoding="utf-8")
    assert main(["walk", "--time", "0.01s", "--model", str(path)]) == 0
    assert "presliding at hip_motor is left out" in capsys.readouterr().err
    # a diagnosis needs no simulator: it has the effect in its equations
    assert [each.cause for each in model_file.read(path, BENCH).effects] == ["cogging", "presliding"]


def test_a_bench_has_the_models_motor_and_shows_what_has_no_part_in_it(tmp_path, capsys):
    path = tmp_path / "model.toml"
    path.write_text(
        '[[term]]\nform = "resistance_change"\nat = "hip_motor"\nchange_ohm = 0.3\n'
        '[[term]]\nform = "cogging"\nat = "hip_motor"\namplitude_Nm = 0.1\nperiods_per_turn = 7\n',
        encoding="utf-8",
    )
    assert main(["identify", "stall", "--model", str(path), "--json", str(tmp_path / "found.json")]) == 0
    said = capsys.readouterr().out
    assert "cogging at hip_motor has no part in stall" in said and "resistance_change" not in said
    (fit,) = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))["fits"]
    low, high = fit["parameters"]["R"]["ci95"]
    assert low < 1.6 < high and high - low < 0.1


def test_a_bench_with_drag_gives_less_torque_at_speed():
    """By 2e-4 N m s^2 at the bench's output: at 10 rad/s 20 mN m."""
    plain, dragged = (
        SuppliedMotor(BENCH_MOTOR, each.of_bench("cantilever"))
        for each in (BenchTerms(), hidden(form="drag", quadratic_Nms2=2e-4 * R**3))
    )
    assert plain.settle(4.0, 10.0)[1] - dragged.settle(4.0, 10.0)[1] == pytest.approx(0.02, rel=1e-9)


def test_springs_and_cables_of_a_model_are_felt_where_they_are_pulled():
    """5 N m/rad^3 in the hip at 0.5 rad: 0.625 N m more, against eq. 1's spring alone."""
    from ranger_sim.sysid.benches import springs

    bent = BenchTerms(terms.Model([{"form": "spring", "at": "hip_joint", "cubic_Nm_per_rad3": 5.0}]).terms)
    plain, with_it = springs.hip_spring(seed=3), springs.hip_spring(seed=3, terms=bent)
    more = with_it["force_N"].value - plain["force_N"].value
    angle, side = plain["angle_rad"].value, plain["side"].value
    # 0.96 m of arm; the scale counts in 0.05 N
    np.testing.assert_allclose(more, side * 5.0 * angle**3 / 0.96, atol=0.06)
    stiff = BenchTerms(
        terms.Model([{"form": "cable_stiffening", "at": "inner_cable", "cubic_Nm_per_rad3": 20.0}]).terms
    )
    plain, with_it = springs.ankle_spring(seed=3), springs.ankle_spring(seed=3, terms=stiff)
    more = (with_it["force_N"].value - plain["force_N"].value) * plain["side"].value
    # counts of both readings; 1 % is the arm's and the scale's gain and the angle's noise, three times over
    np.testing.assert_allclose(more, 20.0 * plain["angle_rad"].value ** 3 / 0.15, atol=0.05, rtol=0.03)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[diagnosis]\nexperiment = 'motor-bench'\ngear = 20.0\n", "found at a gear of 20, not 14"),
        ("[[diagnosis.effect]]\ncause = 1\n", "cause and at are texts"),
        ("[[diagnosis.effect]]\ncause = 'a'\nat = 'b'\nshape = 3\n", "are tables of numbers"),
        ("[diagnosis]\neffect = 3\n", "its effects are written"),
        ("[diagnosis.parameters]\na = 'b'\n", "holds numbers"),
        ("[diagnosis.parameters]\na = nan\n", "holds numbers"),
        ("[diagnosis]\nexperiment = 3\n", "experiment is 3, a name is expected"),
        ("[diagnosis]\ngear = 'a'\n", "gear is 'a', a number above 0 is expected"),
        ("[diagnosis]\ngear = 0\n", "gear is 0, a number above 0 is expected"),
        ("[[diagnosis.effect]]\ncause = 'a'\nat = 'b'\nshape = { n = inf }\n", "are tables of numbers"),
        ("[[term]]\nform = 'cable_slack'\nat = 'inner_cable'\n", "motor-bench does not know cable_slack"),
        ("[weather]\n", "weather is not known here"),
        ("a = [", "not valid TOML"),
    ],
)
def test_what_is_wrong_in_a_model_file_is_reported_in_a_line(text, line, tmp_path):
    path = tmp_path / "model.toml"
    if "diagnosis.effect" in text:
        text = "[diagnosis]\nexperiment = 'motor-bench'\n" + text
    path.write_text(text, encoding="utf-8")
    with pytest.raises(UserError, match=line):
        model_file.read(path, BENCH)
