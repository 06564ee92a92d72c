"""The foot of the body `ranger` is that of the robot's own logs."""

import functools
import os
import pathlib

import numpy as np
import pytest

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.plant import body_files
from tests.plant import foot_identification as identification

DATA = pathlib.Path(os.environ.get("RANGER_SIM_DATA", pathlib.Path(__file__).parents[3] / "shared" / "data"))
LOGS = [DATA / f"ranger_foot_inertia_{number}.csv" for number in range(1, 6)]
with_logs = pytest.mark.skipif(not all(log.exists() for log in LOGS), reason=f"no logs of the foot in {DATA.name}/")


@functools.cache
def found():
    return identification.identify([identification.read(log) for log in LOGS])


def noise(stream, deviation, count):
    return np.array([deviation * stream.normal() for _ in range(count)])


def test_a_foot_made_by_the_law_itself_is_found_again():
    """Known answer: five sines as in the logs, current by the law, 9 ms late and with the logs' scatter of 0.1 A."""
    true = {"J": 0.0031, "C_1": 0.005, "C_0": 0.05, "k": 0.07, "q_0": 1.6, "tau": 0.009}
    stream = RandomStream(5, "foot")
    logs = []
    for hertz in (0.5, 2 / 3, 1.0, 10 / 7, 2.0):
        times = np.arange(0.0, 20.0, 0.004)
        omega = 2.0 * np.pi * hertz

        def motion(t, omega=omega):
            return (
                1.05 + 0.85 * np.sin(omega * t),
                0.85 * omega * np.cos(omega * t),
                -0.85 * omega**2 * np.sin(omega * t),
            )

        at = np.arange(0.1, 19.9, 0.057)
        q, rate, acceleration = motion(at - true["tau"])
        sign = np.tanh(rate / 0.05)
        torque = true["J"] * acceleration + true["C_1"] * rate + true["C_0"] * sign + true["k"] * (q - true["q_0"])
        # T = G K I - mu G K |I| s, solved for I
        current = torque / (0.612 * (1.0 - 0.1 * sign * np.sign(torque)))
        noisy = motion(times)[0] + noise(stream, 3e-4, len(times))  # half a step of the encoder
        logs.append((times, noisy, at, current + noise(stream, 0.1, len(at))))
    answer = identification.identify(logs)
    width = {name: answer.high[name] - answer.low[name] for name in true}
    for name, value in true.items():
        # half the width is two standard errors: four of them miss one time in 16,000; the lag goes in steps of 1 ms
        tolerance = max(width[name], 0.001 if name == "tau" else 0.0)
        assert answer.values[name] == pytest.approx(value, abs=tolerance), name
    assert width["J"] < 0.0003 and width["k"] < 0.03 and width["C_0"] < 0.02  # and they say something


@with_logs
def test_the_body_has_the_foot_of_the_logs():
    body, fit = body_files.load("ranger").values, found()
    rotor = body_files.load("ranger").parameters.ankle_rotor_inertia_kg_m2
    # rounded to the digits that the intervals leave
    assert body["foot_inertia_kg_m2"] == pytest.approx(fit.values["J"] - rotor, abs=0.00005)
    assert body["ankle_return_Nm_per_rad"] == pytest.approx(fit.values["k"], abs=0.001)
    assert body["ankle_return_rest_rad"] == pytest.approx(fit.values["q_0"], abs=0.01)
    for ankle in ("outer", "inner"):
        assert body[f"{ankle}_ankle_constant_friction_Nm"] == pytest.approx(fit.values["C_0"], abs=0.001)
        assert body[f"{ankle}_ankle_viscous_friction_Nms"] == pytest.approx(fit.values["C_1"], abs=0.0005)
        assert body[f"{ankle}_ankle_load_friction"] == identification.LOAD_FRICTION
    assert body["friction_smoothing_rad_s"] == identification.SMOOTHING_RAD_S


@with_logs
def test_the_fit_says_how_sure_it_is_and_no_value_lies_at_the_edge_of_the_search():
    fit = found()
    for name, value in fit.values.items():
        assert fit.low[name] <= value <= fit.high[name]
    # spring, friction and inertia are told from nothing
    assert fit.low["k"] > 0.05 and fit.low["C_0"] > 0.04 and fit.low["C_1"] > 0.0 and fit.low["J"] > 0.0029
    assert identification.LAGS_S[0] < fit.low["tau"] <= fit.high["tau"] < identification.LAGS_S[-1]
    assert fit.explained > 0.8
    # the faster the foot, the more of the current is its motion; at 0.5 Hz half of it does not repeat from turn to turn
    assert fit.explained_by_run[0] > 0.4 and fit.explained_by_run[4] > 0.9
