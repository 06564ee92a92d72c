"""The ankle on a sine: known motions of the bench, and foot, spring and friction back from it."""

import dataclasses
import math
import os
import pathlib

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR
from ranger_sim.sysid.benches import ankle_sine as bench
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.identification import ankle
from ranger_sim.sysid.reading import open_recording

FRICTIONLESS = dataclasses.replace(bench.MOTOR, constant_friction_Nm=0.0, viscous_friction_Nms=0.0, load_friction=0.0)


def test_without_friction_the_joint_follows_the_linear_system_s_frequency_response():
    # Two inertias, a cable, a return spring, a proportional and derivative law: amplitude and phase in closed form.
    body, f = bench.HANGING, 2.0
    rows = bench.tracked(body, FRICTIONLESS, f, 1.0)
    w = 2.0 * math.pi * f
    GK = FRICTIONLESS.gear * FRICTIONLESS.torque_constant_Nm_per_A
    law = GK * (bench.STIFFNESS_A_per_rad + 1j * w * bench.DAMPING_As_per_rad)
    k_s, k_r = body.ankle_spring_Nm_per_rad, body.ankle_return_Nm_per_rad
    J_A, J_f = FRICTIONLESS.reflected_inertia_kg_m2, body.foot_inertia_kg_m2
    at = np.array([[law + k_s - J_A * w * w, -k_s], [-k_s, k_s + k_r - J_f * w * w]])
    motor, joint = np.linalg.solve(at, [law * bench.AMPLITUDE_rad, 0.0])
    held = GK * bench.STIFFNESS_A_per_rad
    rest = np.linalg.solve(
        [[held + k_s, -k_s], [-k_s, k_s + k_r]],
        [held * bench.CENTRE_rad, k_r * body.ankle_return_rest_rad],
    )
    wave = np.exp(1j * w * rows[:, 0])
    # one period is settled before; the law's slow pole K / D = 6.9 1/s has then e^-3.4 of its small start left
    settled = rows[:, 0] > 0.5
    assert rows[settled, 1] == pytest.approx((rest[0] + (motor * wave).imag)[settled], abs=2e-4)
    assert rows[settled, 2] == pytest.approx((rest[1] + (joint * wave).imag)[settled], abs=2e-4)


def test_the_fit_s_simulator_follows_the_bench_s():
    rows = bench.tracked(bench.HANGING, bench.MOTOR, 1.0, 1.0)[::8]
    truth = {
        "J_foot": 0.0013, "k_r": 0.33, "return_Nm": 0.33 * bench.HANGING.ankle_return_rest_rad,
        "ankle_C_0": bench.MOTOR.constant_friction_Nm, "ankle.mu": ANKLE_MOTOR.load_friction, "ankle.k_s": 14.0,
    }  # fmt: skip
    start = float(rows[0, 1]), float(rows[0, 2]), float(rows[0, 3])
    p, a = ankle.simulated(truth, rows[:, 0], rows[:, 4], rows[:, 5], start)
    # double step, targets by straight lines over 4 ms (0.85 w^2 h^2 / 8 = 7e-5 rad), rate of the joint for the motor's
    settled = rows[:, 0] > 0.3
    assert p[settled] == pytest.approx(rows[settled, 1], abs=1.5e-4)
    assert a[settled] == pytest.approx(rows[settled, 2], abs=1.5e-4)


def test_foot_return_spring_and_friction_come_back():
    found = ankle.foot(bench.ankle_sine(seconds=1.6, frequency_hz=2.0))
    for name, true in {"J_foot": 0.0013, "k_r": 0.33, "ankle_C_0": bench.MOTOR.constant_friction_Nm}.items():
        assert abs(found[name] - true) < 3.5 * found.standard_errors[name]
    assert found.standard_errors["J_foot"] < 0.05 * 0.0013


def test_a_log_in_pieces_too_short_to_use_is_reported():
    data = bench.ankle_sine(seconds=0.6)
    with pytest.raises(UserError, match="ankle-sine needs a stretch of 1 s without a gap"):
        ankle.foot(data)
    with pytest.raises(UserError, match="ankle-sine needs the channel motor_angle_rad"):
        ankle.foot(Dataset("none", {"motor_current_A": data["motor_current_A"]}))


FOLDER = pathlib.Path(os.environ.get("RANGER_SIM_DATA", pathlib.Path(__file__).parents[3] / "shared" / "data"))
DATA = FOLDER / "ranger_foot_inertia_5.csv"


@pytest.mark.skipif(not DATA.is_file(), reason="the robot's foot-inertia logs are not here (RANGER_SIM_DATA)")
def test_the_robot_s_own_foot_is_found_and_its_misfit_is_in_the_interval():
    data = open_recording(DATA)
    first = {
        name: dataclasses.replace(each, time_s=each.time_s[each.time_s < 1.6], value=each.value[each.time_s < 1.6])
        for name, each in data.channels.items()
    }
    found = ankle.foot(Dataset(data.name, first))
    assert found.residual_rms > 5.0 and found.rho > 0.9  # the model lacks something, and neighbours tell of it
    total = found.ended_at["J_foot"] + ANKLE_MOTOR.reflected_inertia_kg_m2
    assert 0.0025 < total < 0.0040  # robot.md P3: 0.0031 to 0.0034 in all five runs together
