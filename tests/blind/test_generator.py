"""The blind generator: it shares no model with the diagnosis, hides what it says, and reports nothing."""

import ast
import json
import pathlib
import re
import sys

import numpy as np
import pytest

from tests.blind import generate
from tests.blind.generator.case import Case
from tests.blind.generator.effects import rate
from tests.blind.generator.experiment import NO_PAIR, TIE
from tests.blind.generator.instruments import LSB
from tests.blind.generator.leg_swing import LEG_SWING
from tests.blind.generator.motor_bench import MOTOR_BENCH
from tests.blind.generator.strength import FLOWS_A

HERE = pathlib.Path(__file__).parent
ALLOWED = {"numpy", "scipy", "ranger_sim.foundation.random_arrays"}


def sources():
    return [HERE / "generate.py", *sorted((HERE / "generator").glob("*.py"))]


@pytest.mark.parametrize("path", sources(), ids=lambda path: path.name)
def test_the_generator_imports_no_model_of_the_project(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            names = [node.module] if node.module != "ranger_sim" else [f"ranger_sim.{a.name}" for a in node.names]
        elif isinstance(node, ast.Name):
            assert node.id not in ("__import__", "importlib", "exec", "eval")
        for name in names:
            library = name.partition(".")[0]
            ours = name.startswith("tests.blind.generator")
            assert (
                ours
                or name in ALLOWED
                or library in ("numpy", "scipy", "asammdf")
                or library in sys.stdlib_module_names
            ), name


def made(folder, monkeypatch, *arguments):
    monkeypatch.setattr(MOTOR_BENCH, "SAMPLES", 2000)
    generate.main(["--out", str(folder), *arguments])
    return json.loads((folder / "data" / "cases.json").read_text(encoding="utf-8"))


def test_a_seed_repeats_its_cases_and_another_does_not(tmp_path, monkeypatch, capsys):
    first = made(tmp_path / "one", monkeypatch, "--count", "2", "--kinds", "single", "--causes", "drag", "--seed", "11")
    again = made(tmp_path / "two", monkeypatch, "--count", "2", "--kinds", "single", "--causes", "drag", "--seed", "11")
    other = made(tmp_path / "three", monkeypatch, "--count", "1", "--kinds", "null")  # with a seed of its own
    assert re.findall(r"seed (\d+)", capsys.readouterr().out)[:2] == ["11", "11"]
    assert first == again
    assert first != other
    for case in first:
        for name in case["files"] + case["holdout"]:
            assert (tmp_path / "one/data" / name).read_bytes() == (tmp_path / "two/data" / name).read_bytes()


def test_data_carry_no_label(tmp_path, monkeypatch):
    cases = made(tmp_path, monkeypatch, "--count", "2", "--kinds", "single", "--causes", "drag,cogging", "--seed", "3")
    hidden = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in (tmp_path / "truth").iterdir()}
    assert {case["id"] for case in cases} == set(hidden)
    assert sorted(truth["causes"][0]["name"] for truth in hidden.values()) == ["cogging", "drag"]
    for case in cases:
        assert set(case) == {"id", "experiment", "files", "holdout"}
        for name in case["files"] + case["holdout"]:
            head, *rows = (tmp_path / "data" / name).read_text(encoding="ascii").splitlines()
            assert tuple(head.split(",")) == ("t_s", *MOTOR_BENCH.COLUMNS)
            assert len(rows) == 2000
            assert np.isfinite(np.loadtxt(rows, delimiter=",")).all()
    assert len(list((tmp_path / "data").rglob("*.*"))) == 1 + 2 * len(cases)


def clean(experiment, seed, name=None, amplitude=0.0):
    """A case with one effect of that amplitude, nothing calibrated."""
    case = Case(0, "single")
    if name:
        case.effects = [(name, 1.0)]
    experiment.prepare(seed, case)
    case.amplitudes = [amplitude] * len(case.effects)
    return case


def balances_of(trajectory, true):
    """Balances E, M, T of noise-free data, from the equations in generator/effects.py."""
    p, V, current, w, T = trajectory.base, true["V"], true["I"], true["w"], true["T"]
    GK = p["G"] * p["K"]
    q = trajectory.theta / p["G"]
    leg = p["kh"] * q + p["mgc"] * np.sin(q) - p["mgw"] * np.cos(q)
    sign_I, sign_w = np.sign(trajectory.I), np.sign(trajectory.w)
    acceleration = trajectory.acceleration + rate(w - trajectory.w)
    E = V - p["R"] * current - p["Vc"] * sign_I - p["L"] * rate(current) - GK * w
    friction = (p["C0"] + p["mu"] * GK * sign_I * current) * sign_w + p["C1"] * w
    M = GK * current - p["J"] * acceleration - friction - T - leg
    return E, M, rate(true["theta"]) / p["G"] - w


# Amplitudes of about what calibration finds at a strength of 4, or some times that where the formula holds.
LARGE = {
    "contact_drop_change": 0.5,
    "resistance_temperature": 0.01,
    "torque_constant_temperature": 0.005,
    "current_step_at_zero_duty": 0.1,
    "sensor_scale": 0.05,
    "sensor_offset": 0.1,
    "voltage_clip": 0.3,
    "cogging": 0.04,
    "commutation_ripple": 0.01,
    "once_per_turn": 0.04,
    "stribeck": 0.1,
    "presliding": 0.01,
    "load_friction": 0.1,
    "direction_friction": 0.02,
    "friction_warm_up": 0.1,
    "cable_backlash": 0.005,
    "eccentricity": 0.005,
    "lost_counts": 0.01,
    "sensor_lag": 0.0004,
    "clock_drift": 0.0012,
    "drag": 3e-4,
    "tight_arc_friction": 0.1,
    "eddy_brake_saturating": 0.05,
    "magnetic_hysteresis": 0.08,
    "voltage_ripple_torque": 0.01,
    "iron_saturation": 0.1,
    "mains_pickup": 0.1,
    "rattling_coupling": 0.1,
    "load_cell_creep": 0.1,
}


LARGE_ON_A_LEG = {
    "contact_drop_change": 0.5,
    "resistance_temperature": 0.01,
    "torque_constant_temperature": 0.005,
    "current_step_at_zero_duty": 0.1,
    "sensor_offset": 0.1,
    "voltage_clip": 0.3,
    "cogging": 0.3,
    "commutation_ripple": 0.05,
    "stribeck": 0.2,
    "presliding": 0.01,
    "friction_warm_up": 0.5,
    "drag": 0.1,
    "hip_spring_bend": 0.3,
    "sensor_lag": 0.0005,
    "tight_arc_friction": 10.0,
    "eddy_brake_saturating": 1.0,
    "magnetic_hysteresis": 0.5,
    "voltage_ripple_torque": 0.05,
    "iron_saturation": 0.5,
    "mains_pickup": 0.1,
}
EVERY = [("motor-bench", name) for name in LARGE] + [("leg-swing", name) for name in LARGE_ON_A_LEG]
AMPLITUDES = {"motor-bench": LARGE, "leg-swing": LARGE_ON_A_LEG}


@pytest.fixture(scope="module")
def large_effects():
    """{(experiment, effect): (case, trajectory)}, three seconds each, in lanes of one simulation per experiment."""
    out = {}
    for experiment in (MOTOR_BENCH, LEG_SWING):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(experiment, "SAMPLES", 3000)
            amplitudes = AMPLITUDES[experiment.NAME]
            cases = {name: clean(experiment, 23, name, amplitude) for name, amplitude in amplitudes.items()}
            lanes = experiment.lanes_of([(case, case.runs[0]) for case in cases.values()])
            experiment.let_act(lanes, cases.values())
            for (name, case), trajectory in zip(cases.items(), lanes.run(), strict=True):
                out[experiment.NAME, name] = case, trajectory
    return out


@pytest.mark.parametrize("experiment", [MOTOR_BENCH, LEG_SWING], ids=lambda experiment: experiment.NAME)
def test_every_effect_is_tried_large(experiment):
    assert set(AMPLITUDES[experiment.NAME]) == set(experiment.EFFECTS)


@pytest.mark.parametrize("name, effect", EVERY)
def test_what_an_effect_shows_is_what_it_does(name, effect, large_effects):
    """The balances of simulated data, less what the effect's own formula says, leave little of it.

    A seventh: the formulas are of first order in the amplitude. 6: what corners within a sample leave without any
    effect is 2-4 here, in units of the noise, summed over the run.
    """
    experiment = {"motor-bench": MOTOR_BENCH, "leg-swing": LEG_SWING}[name]
    case, trajectory = large_effects[name, effect]
    true = experiment.true_channels(trajectory)
    experiment.apply_instruments(case, trajectory, true)
    scale = experiment.scale(case, trajectory)
    got = scale.vector(balances_of(trajectory, true))
    wanted = scale.vector(experiment.balances(effect, trajectory, case.shapes[0], case.amplitudes[0]))
    assert np.linalg.norm(wanted) > 20.0
    assert np.linalg.norm(got - wanted) < np.linalg.norm(wanted) / 7.0 + 6.0


@pytest.mark.parametrize("experiment", [MOTOR_BENCH, LEG_SWING], ids=lambda experiment: experiment.NAME)
def test_an_experiment_without_effects_keeps_its_own_balances(experiment, monkeypatch):
    """What ten steps a sample leave in the balances is far below what any detector sees: a strength of 0.5 at most."""
    monkeypatch.setattr(experiment, "SAMPLES", 3000)
    case = clean(experiment, 5)
    trajectory = experiment.lanes_of([(case, case.runs[0])]).run()[0]
    scale = experiment.scale(case, trajectory)
    assert scale.strength(balances_of(trajectory, experiment.true_channels(trajectory))) < 0.5
    assert np.mean(np.abs(trajectory.w) > experiment.MOVES_RAD_S) > 0.5
    assert np.mean(np.abs(trajectory.I) > FLOWS_A) > 0.4


def test_what_no_recording_can_distinguish_is_a_tie_of_the_truth(monkeypatch):
    """Friction by direction is an offset of the load cell, also where only the current's offset is hidden; a torque
    ripple that goes with the voltage is not cogging, though both have the same period and phase.
    """
    monkeypatch.setattr(MOTOR_BENCH, "SAMPLES", 2000)
    for name, other, tied in (
        ("direction_friction", "sensor_offset", True),
        ("voltage_ripple_torque", "cogging", False),
    ):
        case = clean(MOTOR_BENCH, 5, name, 0.02)  # a run in both directions
        trajectory = MOTOR_BENCH.lanes_of([(case, case.runs[0])]).run(fine=2)[0]
        cosines = MOTOR_BENCH.rivals(5, case, MOTOR_BENCH.scale(case, trajectory))
        assert (cosines[other] > TIE) is tied


def test_a_size_is_reported_in_the_catalogue_s_form(monkeypatch):
    """Drag with the square is the catalogue's own; friction by bristles is near a Gaussian of about its size."""
    monkeypatch.setattr(MOTOR_BENCH, "SAMPLES", 2000)
    told = {}
    for name, shape, amplitude in (
        ("drag", {"power": 2.0}, 3e-4),
        ("stribeck", {"speed_rad_s": 2.0, "stretch_rad": 2e-4}, 0.1),
    ):
        case = clean(MOTOR_BENCH, 5, name, amplitude)
        case.shapes = [shape]
        trajectory = MOTOR_BENCH.lanes_of([(case, case.runs[0])]).run(fine=2)[0]
        told[name] = MOTOR_BENCH.truth(case, MOTOR_BENCH.scale(case, trajectory), {})["causes"][0]["parameters"]
    assert told["drag"] == {"quadratic_Nms2": pytest.approx(3e-4)}
    assert told["stribeck"]["excess_Nm"] == pytest.approx(0.1, rel=0.3)
    assert told["stribeck"]["speed_rad_s"] == pytest.approx(2.0, rel=0.5)


def test_a_fast_effect_counts_less_where_the_speed_is_differentiated_and_a_slow_one_as_much():
    """The noise in balance M at a frequency is that of its channels and of the inertia times the speed's derivative."""
    case = clean(MOTOR_BENCH, 23)
    base, noise = case.base, case.instruments.noise
    v = {name: deviation**2 + LSB[name] ** 2 / 12.0 for name, deviation in noise.items()}
    count = 4000
    deviations = case.instruments.balance_deviations(base, count)
    flat = v["T"] + (base["G"] * base["K"]) ** 2 * v["I"] + base["C1"] ** 2 * v["w"]
    for place, omega in ((0, 0.0), (8, 2.0 * np.pi * 2.0), (400, 2.0 * np.pi * 100.0)):  # 1 ms samples
        grows = base["J"] ** 2 * omega**2 * v["w"]
        # 2 %: a difference over a sample has less than the derivative at 100 Hz
        assert deviations[1][place] == pytest.approx(np.sqrt(flat + grows), rel=0.02)


def test_two_effects_on_one_quantity_both_act():
    """As much of a warm magnet's loss is left with the ripple of the torque constant as alone."""
    amplitudes = {"torque_constant_temperature": 0.005, "commutation_ripple": 0.01}
    shown = {}
    for names in (("torque_constant_temperature",), ("commutation_ripple", "torque_constant_temperature"), ()):
        case = Case(0, "pair", effects=[(name, 1.0) for name in names])
        MOTOR_BENCH.lasting(3.0).prepare(23, case)
        case.amplitudes = [amplitudes[name] for name in names]
        experiment = MOTOR_BENCH.lasting(3.0)
        lanes = experiment.lanes_of([(case, case.runs[0])])
        experiment.let_act(lanes, [case])
        t = lanes.run()[0]
        # back-EMF per speed, from the voltage balance; where it turns fast nothing else matters
        fast = (np.abs(t.w) > 3.0) & (np.abs(t.I) > 0.3)
        drop = t.V - t.base["R"] * t.I - t.base["Vc"] * np.sign(t.I) - t.base["L"] * rate(t.I)
        shown[names] = float(np.mean(drop[fast] / t.w[fast]))
    alone, both, none = (shown[names] for names in shown)
    assert abs(alone - none) > 1e-3 * none
    assert both - none == pytest.approx(alone - none, rel=0.05)


def test_no_pair_is_one_effect_twice():
    plan = MOTOR_BENCH.plan(7, 400, ("pair",), MOTOR_BENCH.CAUSES)
    pairs = [{name for name, _ in case.effects} for case in plan]
    assert len(pairs) == 400
    assert not any(pair in NO_PAIR for pair in pairs)


def test_what_a_leg_does_faster_than_its_angle_shows_is_drowned():
    """A torque at 0.5 Hz is judged by the current's noise; at 50 Hz by the acceleration, from the quieter of two rates.

    J times a rate's slope: from the angle J (2 pi f)^2 of its noise, from the back-EMF J 2 pi f of R I's noise over K.
    """
    case = LEG_SWING.plan(1, 1, ["null"], LEG_SWING.CAUSES)[0]
    LEG_SWING.prepare(1, case)
    base, noise, count = case.base, case.instruments.noise, 20000
    _, torque, _ = case.instruments.balance_deviations(base, count)
    K, turn = base["G"] * base["K"], 2.0 * np.pi * 50.0
    assert torque[10] == pytest.approx(K * noise["I"], rel=0.2)
    by_angle, by_voltage = base["J"] * turn**2 * noise["q"], base["J"] * turn * base["R"] * noise["I"] / K
    drowned = 1.0 / np.hypot(1.0 / by_angle, 1.0 / by_voltage)
    # the counts of the angle and the voltage's own noise come on top
    assert drowned < torque[1000] < 1.3 * drowned


def test_an_effect_that_hides_along_a_trajectory_is_hidden_along_another_one(tmp_path):
    """Friction by direction where all motion is in one: 100 N m of it were needed, and the bench ran away."""
    short = MOTOR_BENCH.lasting(2.0)
    planned = short.fill(5, [("single", "direction_friction", 4.0)] * 30, MOTOR_BENCH.CAUSES)
    cases = [case for case in planned if case.number == 12]
    ((key, files, holdout, truth),) = short.generate(5, cases, tmp_path)
    assert abs(truth["causes"][0]["amplitude"]) < 0.1
    for name in (*files, *holdout):
        table = np.genfromtxt(tmp_path / name, delimiter=",", names=True)
        assert np.all(np.isfinite(table["speed_rad_per_s"])) and np.max(np.abs(table["speed_rad_per_s"])) < 50.0
    assert files[0].startswith(key)
