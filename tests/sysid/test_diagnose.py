"""Data with a known fault and their diagnosis: a name, a tie, a shrug or nothing; real data; a user's machine."""

import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest

import ranger_sim
from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.diagnosis import KnownEffect
from ranger_sim.sysid.machine import Effect, Equation, Known, Quantity, Recording
from ranger_sim.sysid.machines import EXPERIMENTS
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.tools.cli import main

SIZE = 6000
STEP_S = 0.01


class Cart:
    """A cart pushed along a rail: F = m a + c v. It may have drag, a slope, or a magnet along the rail."""

    name = "cart"
    quantities = (Quantity("force_N", "N", "push"), Quantity("v_m_per_s", "m/s", "speed"))
    parameters = (
        Known("mass_kg", "kg", 1.0, 0.0, 10.0, "of the cart"),
        Known("damping", "N s/m", 0.1, 0.0, 10.0, "oil"),
    )

    def prepare(self, table):
        v = table["v_m_per_s"]
        a = np.gradient(v, table.step_s)
        valid = np.ones(len(v), dtype=bool)
        force = Equation("force", "M", "mechanical", "N", table["force_N"], {"mass_kg": a, "damping": v}, valid)
        return Recording(table, {"v": v, "a": a, "t": table.time_s, "x": np.cumsum(v) * table.step_s}, {"force": force})

    def effects(self, recordings):
        def one(make):
            return lambda r, shape, values: {"force": make(r.signals, shape)[:, None]}

        return [
            Effect("drag", "cart", "mechanical", ("quadratic",), [{}], one(lambda s, p: s["v"] * np.abs(s["v"]))),
            Effect("floor", "rail", "mechanical", ("slope_N",), [{}], one(lambda s, p: np.ones_like(s["v"]))),
            Effect("sensor_offset", "force_N", "sensor", ("offset_N",), [{}], one(lambda s, p: np.ones_like(s["v"]))),
        ]

    def generic(self, recording):
        return {"force": {name: recording.signals[name] for name in ("v", "x", "t")}}


def cart_run(seed, drag=0.0, slope=0.0, magnet=0.0):
    rng = generator(seed, "cart")
    t = np.arange(SIZE) * STEP_S
    parts = [(rng.uniform(0.2, 1.0), rng.uniform(0.2, 2.0), rng.uniform(0.0, 6.0)) for _ in range(5)]
    v = sum(size * np.sin(rate * t + phase) for size, rate, phase in parts)
    a = sum(size * rate * np.cos(rate * t + phase) for size, rate, phase in parts)
    x = np.cumsum(v) * STEP_S
    force = 1.1 * a + 0.12 * v + drag * v * np.abs(v) + slope + magnet * np.exp(-((x / 0.3) ** 2))
    force += 0.05 * rng.normal(size=SIZE)
    return Table(t, {"force_N": force, "v_m_per_s": v}, (slice(0, SIZE),), f"run {seed}")


def diagnosed(holdout=True, **fault):
    held = [cart_run(2, **fault)] if holdout else []
    return diagnose(Cart(), [cart_run(1, **fault)], held).answer


def test_a_cause_is_named_with_its_value_and_gains_on_a_run_that_was_not_seen():
    found = diagnosed(drag=0.02)
    assert found["detected"] and not found["abstained"]
    (cause,) = found["causes"]
    assert (cause["name"], cause["at"], cause["balance"], cause["tied_with"]) == ("drag", "cart", "M", [])
    value = cause["parameters"]["quadratic"]
    assert value["ci95"][0] < 0.02 < value["ci95"][1]
    assert found["subsystem"] == "mechanical"
    # everything that repeats is the drag: all but the bootstrap's own spread is won
    assert found["gain"]["fraction_of_achievable"] > 0.9 and found["gain"]["ci95"][0] > 0.5
    assert not found["gain"]["worse"]
    json.dumps(found, allow_nan=False)


def test_what_the_data_cannot_distinguish_is_a_tie():
    found = diagnosed(slope=0.02)
    (cause,) = found["causes"]
    assert {cause["name"], *cause["tied_with"]} == {"floor", "sensor_offset"}
    assert found["next_experiment"]


def test_what_the_model_has_already_is_not_a_finding():
    known = [KnownEffect("drag", "cart", {"quadratic": 0.021}, {})]
    found = diagnose(Cart(), [cart_run(1, drag=0.02)], known=known).answer
    assert not found["detected"] and found["causes"] == []
    (had,) = found["evidence"]["known"]
    value = had["parameters"]["quadratic"]
    assert value["model"] == 0.021 and value["ci95"][0] < 0.02 < value["ci95"][1]
    both = diagnose(Cart(), [cart_run(1, drag=0.02, slope=0.02)], known=known).answer
    assert len(both["causes"]) == 1 and both["causes"][0]["name"] in ("floor", "sensor_offset")


def test_a_known_effect_that_the_channels_cannot_show_is_a_mistake():
    with pytest.raises(UserError, match="the model has cogging at cart, which these channels cannot show"):
        diagnose(Cart(), [cart_run(1)], known=[KnownEffect("cogging", "cart", {"amplitude_Nm": 0.1}, {})])


def test_progress_is_reported_from_none_to_all():
    told = []
    diagnose(Cart(), [cart_run(1, drag=0.02)], [cart_run(2)], progress=lambda what, share: told.append((what, share)))
    shares = [share for _, share in told]
    assert shares[0] == 0.0 and shares[-1] == 1.0 and shares == sorted(shares)
    assert {"misfit", "causes", "gain"} <= {what for what, _ in told}


def test_two_causes_are_both_named():
    found = diagnosed(drag=0.02, slope=0.02)
    assert {each["name"] for each in found["causes"]} & {"floor", "sensor_offset"}
    assert "drag" in {each["name"] for each in found["causes"]}
    assert len(found["causes"]) == 2


def test_a_fault_outside_the_catalogue_is_detected_and_given_no_name():
    found = diagnosed(magnet=0.15)
    assert found["detected"] and found["abstained"] and found["causes"] == []
    assert found["evidence"]["parameters_are_physical"] is False
    assert found["subsystem"] == "mechanical"


def test_sound_data_raise_no_alarm():
    """60 sound runs: with alarms in 2 % of them, more than 8 come in one of 10^5."""
    alarms = sum(diagnose(Cart(), [cart_run(seed)]).answer["detected"] for seed in range(1000, 1060))
    assert alarms <= 8


def test_a_small_fault_is_found_as_often_as_its_size_says():
    """z = sqrt(N) rms(drag outside the base) / noise is about 8: a normal deviate less than 4.4 below it is rare."""
    found = [diagnose(Cart(), [cart_run(seed, drag=0.01)]).answer for seed in range(2000, 2020)]
    assert sum(each["detected"] for each in found) >= 18
    assert sum(bool(each["causes"]) and each["causes"][0]["name"] == "drag" for each in found) >= 18


def test_a_parameter_that_no_machine_can_have_is_reported():
    run = cart_run(1)
    backwards = Table(run.time_s, {"force_N": -run["force_N"], "v_m_per_s": run["v_m_per_s"]}, run.runs, run.name)
    found = diagnose(Cart(), [backwards]).answer
    assert found["evidence"]["impossible"] == ["mass_kg", "damping"]
    assert found["evidence"]["parameters_are_physical"] is False
    assert diagnosed(holdout=False)["evidence"]["impossible"] == []


def test_the_same_data_have_the_same_answer():
    assert json.dumps(diagnosed(drag=0.02)) == json.dumps(diagnosed(drag=0.02))


# --- the command -------------------------------------------------------------------------------------------------


def cart_file(path, seed=1, **fault):
    run = cart_run(seed, **fault)
    rows = np.column_stack([run.time_s, run["force_N"], run["v_m_per_s"]])
    np.savetxt(path, rows, delimiter=",", header="t_s,force_N,v_m_per_s", comments="", fmt="%.9g")
    return str(path)


@pytest.fixture
def own_machine(tmp_path, monkeypatch):
    """A user's module with a machine, where the command is started."""
    (tmp_path / "my_cart.py").write_text("from tests.sysid.test_diagnose import Cart\n", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def test_a_machine_of_the_users_own_is_diagnosed_by_the_command(own_machine, capsys):
    one, other = (cart_file(own_machine / f"{seed}.csv", seed, drag=0.02) for seed in (1, 2))
    code = main(
        ["diagnose", one, "--holdout", other, "--experiment", "my_cart:Cart", "--out", "found", "--json", "a.json"]
    )
    assert code == 1
    said = capsys.readouterr().out
    assert said.startswith("cart: the mechanical part is wrong: drag at cart, ")
    told = json.loads((own_machine / "a.json").read_text(encoding="utf-8"))
    assert told["causes"][0]["name"] == "drag"
    assert told["model_file"] == "found/extended.toml"
    assert json.loads((own_machine / "found" / "diagnosis.json").read_text(encoding="utf-8")) == told
    assert "drag at cart" in (own_machine / "found" / "report.html").read_text(encoding="utf-8")
    assert 'cause = "drag"' in (own_machine / "found" / "extended.toml").read_text(encoding="utf-8")
    assert main(["diagnose", cart_file(own_machine / "sound.csv"), "--experiment", "my_cart:Cart"]) == 0
    assert "nothing that these data could show is missing" in capsys.readouterr().out
    # what the model has already is no finding
    model = ["--model", str(own_machine / "found" / "extended.toml")]
    assert main(["diagnose", other, "--experiment", "my_cart:Cart", *model]) == 0
    assert "known: drag at cart: quadratic 0.0" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["none.csv", "--experiment", "motor-bench"], "none.csv: there is no such file"),
        (
            ["data.csv", "--experiment", "moon"],
            f"--experiment moon: unknown experiment 'moon' (available: {', '.join(EXPERIMENTS)}); a machine of yours",
        ),
        (["data.csv", "--experiment", "nowhere:Cart"], "--experiment nowhere:Cart: No module named 'nowhere'"),
        (["data.csv", "--experiment", "json:dumps"], "--experiment json:dumps: it has no name, quantities"),
        (["data.csv", "--experiment", "positioning", "--gear", "3"], "--gear 3: only the motor bench has a gearbox"),
        (["data.csv", "--experiment", "motor-bench"], "data.csv: motor-bench needs voltage_V"),
    ],
)
def test_a_mistake_is_reported_in_a_line(arguments, line, own_machine, capsys):
    cart_file(own_machine / "data.csv")
    assert main(["diagnose", *arguments]) == 2
    error = capsys.readouterr().err
    assert line in error and error.count("\n") == 1


@pytest.mark.parametrize("gear", ["0", "-14", "1e5"])
def test_a_gear_that_none_has_is_refused_before_anything_is_read(gear, capsys):
    with pytest.raises(SystemExit) as left:
        main(["diagnose", "none.csv", "--experiment", "motor-bench", "--gear", gear])
    error = capsys.readouterr().err
    assert left.value.code == 2 and f"'{gear}' must be at least 0.01 and at most 10000" in error


@pytest.mark.parametrize(
    "text",
    [
        "",
        "t_s\n",
        "t_s,force_N,v_m_per_s\n",
        "t_s,force_N,v_m_per_s\n0,1,2\n",
        "t_s,force_N,v_m_per_s\n" + "0,1,2\n" * 50,
        "t_s,force_N,v_m_per_s\n" + "".join(f"{n},nan,nan\n" for n in range(100)),
        "t_s,force_N,v_m_per_s\n" + "".join(f"{n},1,2\n" for n in range(40)),
        "force_N\n" + "1\n" * 100,
        "\x00\x01\x02",
    ],
)
def test_data_that_say_nothing_are_reported_in_a_line_and_never_blamed_on_a_cause(text, own_machine, capsys):
    (own_machine / "bad.csv").write_text(text, encoding="utf-8")
    assert main(["diagnose", "bad.csv", "--experiment", "my_cart:Cart"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("ranger-sim: bad.csv") and error.count("\n") == 1


# --- the motor bench, by data of another program ------------------------------------------------------------------


def test_a_fault_of_the_motor_bench_is_named(tmp_path):
    """Four times the least strength that is found nine times in ten: of such, all but 1 % are detected."""
    cause, part = "resistance_temperature", "electrical"
    folder = tmp_path / "cases"
    program = [
        "-m",
        "tests.blind.generate",
        "--kinds",
        "single",
        "--causes",
        cause,
        "--strength",
        "4.0",
        "--count",
        "1",
        "--seconds",
        "8",
    ]
    root = pathlib.Path(__file__).resolve().parents[2]
    command = [sys.executable, *program, "--seed", "11", "--out", str(folder)]
    subprocess.run(command, check=True, cwd=root, capture_output=True)
    (case,) = json.loads((folder / "data" / "cases.json").read_text(encoding="utf-8"))
    files, held = ([str(folder / "data" / each) for each in case[role]] for role in ("files", "holdout"))
    found = ranger_sim.diagnose(files, "motor-bench", holdout=held).to_dict()
    assert found["detected"]
    assert found["causes"][0]["name"] == cause
    assert found["subsystem"] == part


# --- real data ------------------------------------------------------------------------------------------------

DATA = pathlib.Path(os.environ.get("RANGER_SIM_DATA", pathlib.Path(__file__).parents[3] / "shared" / "data"))


@pytest.mark.skipif(not (DATA / "emps_run1.csv").is_file(), reason="the two EMPS runs are not here (RANGER_SIM_DATA)")
def test_the_positioning_machine_is_wrong_where_its_literature_says():
    """Published: M 95.1089 kg, F_v 203.50 N s/m, F_c 20.39 N; friction that differs by direction first."""
    run, pulses = DATA / "emps_run1.csv", DATA / "emps_run2_pulses.csv"
    found = ranger_sim.diagnose(run, "positioning", holdout=[pulses]).to_dict()
    names = [each["name"] for each in found["causes"]]
    # the command is held from row to row: on straight lines it would be 0.7 ms early
    assert names == ["direction_friction", "presliding"]
    # a ripple of 2.50 mm is in run 1 and at another phase in run 2: it must not be kept
    assert found["evidence"]["refused_by_holdout"] == ["once_per_turn at guide"]
    assert found["gain"]["fraction_of_achievable"] > 0.8
    errors = found["evidence"]["held_out_errors"]["force"]
    assert errors["after"] < 0.015 and errors["after"] < 0.45 * errors["before"]
    parameters = found["evidence"]["parameters"]
    assert parameters["mass_kg"]["value"] == pytest.approx(95.1, rel=0.01)


def test_an_unknown_machine_is_refused():
    with pytest.raises(UserError, match="available: motor-bench, leg-swing, positioning, ankle, walk"):
        ranger_sim.diagnose("none.csv", "mars")
