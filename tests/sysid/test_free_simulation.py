"""The free simulation against another integrator, and a user's arm whose data come from that integrator as well."""

import json
import pathlib
import sys

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.free_simulation.fit import TrajectoryFit
from ranger_sim.sysid.free_simulation.predictor import Predictor
from ranger_sim.sysid.pipeline import diagnose
from ranger_sim.tools.cli import main

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "examples"))
from servo_arm import WEIGHT_NM, ServoArm  # noqa: E402

STEP_S, COUNT = 0.005, 4000
TRUE = {"inertia": 0.06, "push": 0.35, "damping": 0.35, "friction": 0.12}
SENSOR_RAD, SUPPLY_V = 0.0005, 0.02


def waves(seed):
    """A voltage of some sines: a function of time that swings the arm both ways."""
    rng = generator(seed, "waves")
    parts = [(rng.uniform(0.8, 2.0), rng.uniform(0.5, 6.0), rng.uniform(0.0, 6.0)) for _ in range(5)]
    return lambda t: sum(size * np.sin(rate * t + phase) for size, rate, phase in parts)


def swung(volts, true=TRUE, extra=lambda t, q, w: 0.0, lost=lambda v: 0.0, step_s=STEP_S):
    """(time, angle, rate) by an integrator and equations of the test's own."""

    def rates(t, y):
        q, w = y
        v = volts(t)
        torque = true["push"] * (v - lost(v)) - true["damping"] * w - true["friction"] * np.tanh(w / 0.02)
        return w, (torque - WEIGHT_NM * np.sin(q) + extra(t, q, w)) / true["inertia"]

    time_s = np.arange(COUNT) * step_s
    done = solve_ivp(rates, (0.0, time_s[-1]), (0.1, 0.0), t_eval=time_s, rtol=1e-8, atol=1e-10, max_step=0.01)
    return time_s, *done.y


def log(seed, **fault):
    """What the user's logger has of a run: noise on both channels, the angle in counts of 13 bits."""
    volts, rng = waves(seed), generator(seed, "noise of the log")
    time_s, angle, _ = swung(volts, **fault)
    count = 2.0 * np.pi / 8192
    angle = np.round((angle + SENSOR_RAD * rng.normal(size=COUNT)) / count) * count
    measured = volts(time_s) + SUPPLY_V * rng.normal(size=COUNT)
    return Table(
        time_s, {"voltage_V": measured, "angle_rad": angle}, (slice(0, COUNT),), f"run {seed}", {"angle_rad": count}
    )


class Exact(ServoArm):
    """The arm without any noise of its input."""

    noisy_inputs = {}  # noqa: RUF012


class Smooth(ServoArm):
    """The arm as its data are made: with a smoothed sign, nothing open where it stands."""

    def loose(self, x, u, p, step_s):
        return {}


FOUND = ("inertia_kg_m2", "torque_Nm_per_V", "damping_Nms", "friction_Nm")


def test_sensitivities_are_those_of_another_integrator():
    """Differences of two whole simulations by solve_ivp; what a gain of nothing leaves is the plain forward recursion.

    At 1 kHz, for a step of the recursion must be short compared with friction's turn of sign: J 0.02 / C, 10 ms.
    """
    volts = waves(5)
    time_s, angle, rate = swung(volts, step_s=0.001)
    fit = TrajectoryFit(Exact(), Table(time_s, {"voltage_V": volts(time_s), "angle_rad": angle}, (slice(0, COUNT),)))
    fit.x = np.column_stack((angle, rate))
    fit.p = np.array(list(TRUE.values()))
    lin = fit.linearise()
    free = Predictor(lin, np.zeros(0), np.array([1.0]), np.zeros((COUNT, 2)), np.array([0]), np.zeros(2))
    assert not free.gain.any()
    found = free.errors(lin.f_p, lin.h_p)[:, 0]
    for number, name in enumerate(TRUE):
        high, low = (swung(volts, {**TRUE, name: TRUE[name] * part}, step_s=0.001)[1] for part in (1.001, 0.999))
        wanted = (high - low) / (0.002 * TRUE[name])
        assert np.max(np.abs(found[:, number] - wanted)) < 0.01 * np.max(np.abs(wanted)), name
    # a torque that enters at a port, here like a spring
    response = free.errors(lin.f_q[:, :, 0, None] * -angle[:, None, None], lin.h_q[:, :, 0, None])[:, 0, 0]
    high, low = (swung(volts, extra=lambda t, q, w, k=k: -k * q, step_s=0.001)[1] for k in (0.002, -0.002))
    wanted = (high - low) / 0.004
    assert np.max(np.abs(response - wanted)) < 0.01 * np.max(np.abs(wanted))


def test_the_parameters_are_found_within_their_errors_and_a_sound_arm_raises_no_alarm():
    """Four errors beyond 4 standard errors come in one of 4000 runs; a false alarm in one of a hundred at most."""
    told = diagnose(ServoArm(), [log(1)]).answer
    for name, true in zip(FOUND, TRUE.values(), strict=True):
        value = told["evidence"]["parameters"][name]
        error = (value["ci95"][1] - value["ci95"][0]) / (2.0 * 1.96)
        assert abs(value["value"] - true) < 4.0 * error, name
        assert error < 0.01 * true, name  # nothing would be found if the errors were told too large
    assert not told["detected"]


def test_what_free_simulation_misses_of_a_sound_arm_is_what_noise_makes_it_miss():
    """Window by window, with what is true: the sensor's noise and counts, and what the voltage's noise drives.

    J q'' + d q' + k q under white torque of density S has the variance S / (2 d k).
    """
    arm = Smooth()
    free = arm.free(arm.prepare(log(1))).equations["angle_rad"]
    missed = free.response - sum(free.columns[name] * true for name, true in zip(FOUND, TRUE.values(), strict=True))
    driven = TRUE["push"] * SUPPLY_V * np.sqrt(STEP_S / (2.0 * TRUE["damping"] * WEIGHT_NM))
    count = 2.0 * np.pi / 8192 / np.sqrt(12.0)
    # friction damps a little more, and the weight's slope is k cos q; 10 windows of a noise that lasts 0.3 s
    assert np.std(missed) == pytest.approx(np.sqrt(SENSOR_RAD**2 + count**2 + driven**2), rel=0.1)


def test_an_effect_that_is_taken_back_leaves_the_simulator_as_it_was():
    """As when it is named at first, and no longer once it has acted; a round ends within a tenth of an error."""
    arm = Exact()
    without = arm.prepare(log(1).part(slice(0, 1000)))
    (drag,) = (each for each in arm.effects([without]) if each.cause == "drag")
    acting = arm.again(without, [(drag, {}, [0.5])], fixed=True)
    assert abs(acting.fitted["damping_Nms"] - without.fitted["damping_Nms"]) > 0.01
    back = arm.again(acting, [])
    assert back.fitted == pytest.approx(without.fitted, rel=1e-4)
    assert not back.fit.acting
    response, wanted = (each.equations["angle_rad"].response for each in (back, without))
    assert response == pytest.approx(wanted, abs=1e-3 * float(np.ptp(wanted)))


def test_a_fit_that_has_settled_with_the_same_effects_is_the_answer_already():
    """Whatever their coefficients would have started from; not with others, nor where coefficients stay."""
    arm = Exact()
    without = arm.prepare(log(1).part(slice(0, 1000)))
    (drag,) = (each for each in arm.effects([without]) if each.cause == "drag")
    acting = arm.again(without, [(drag, {}, [0.001])])
    assert acting.fit.settled
    assert arm.again(acting, [(drag, {}, [0.002])]) is acting
    assert arm.again(acting, []) is not acting
    stays = arm.again(acting, [(drag, {}, [0.002])], fixed=True)
    assert stays is not acting and stays.fit.p[-1] == 0.002
    assert arm.again(stays, [(drag, {}, [0.002])]).fit.p[-1] == pytest.approx(acting.fit.p[-1], abs=1e-4)


def test_a_recording_that_says_nothing_is_reported_in_a_sentence():
    run = log(1)
    still = Table(run.time_s, {"voltage_V": run["voltage_V"], "angle_rad": np.zeros(COUNT)}, run.runs, "still")
    with pytest.raises(UserError, match="still: angle_rad never changes; servo-arm can be judged in motion only"):
        ServoArm().prepare(still)
    with pytest.raises(UserError, match="run 1: the longest stretch without a gap is 1 s, servo-arm needs 2 s"):
        ServoArm().prepare(run.part(slice(0, 200)))
    with pytest.raises(UserError, match="no voltage: servo-arm needs voltage_V; there are angle_rad"):
        ServoArm().prepare(Table(run.time_s, {"angle_rad": run["angle_rad"]}, run.runs, "no voltage"))


def test_a_users_arm_is_diagnosed_by_the_command(tmp_path, monkeypatch, capsys):
    """The example as its document has it: a supply that sags, by name, with its size, on two runs.

    At 7 V it takes a quarter of the voltage. By its first order about an arm without it nothing could be named: it acts
    in the simulator, and the size is known to a hundredth.
    """
    monkeypatch.chdir(ROOT)
    for seed in (7, 8):
        run = log(seed, lost=lambda v: 0.04 * v * abs(v))
        rows = np.column_stack((run.time_s, run["voltage_V"], run["angle_rad"]))
        np.savetxt(tmp_path / f"{seed}.csv", rows, "%.9g", ",", header="t_s,voltage_V,angle_rad", comments="")
    one, other = str(tmp_path / "7.csv"), str(tmp_path / "8.csv")
    arguments = ["--experiment", "examples.servo_arm:ServoArm", "--json", str(tmp_path / "found.json")]
    assert main(["diagnose", one, "--holdout", other, *arguments]) == 1
    assert "servo-arm: the electrical part is wrong: supply_sag at supply, " in capsys.readouterr().out
    told = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))
    (cause,) = told["causes"]
    low, high = cause["parameters"]["per_V"]["ci95"]
    assert 0.0392 < low < 0.04 < high < 0.0408
    assert told["gain"]["fraction_of_achievable"] > 0.95
