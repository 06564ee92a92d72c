"""Sound recordings of motor benches that are not ours raise no alarm: any cause that is named for them is false.

The generator here shares nothing with sysid/benches: 20 us steps, friction that truly sticks, voltage in steps, values
taken at a point or as the mean over the sample, an encoder that counts.
"""

import pathlib

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.tools import cli

DATA = pathlib.Path(__file__).resolve().parents[2].parent / "shared" / "data"
STEP_S = 2e-5
GEAR = 14.0
COUNT_RAD = 2.0 * np.pi / 2048
NAMES = "t_s,voltage_V,current_A,speed_rad_per_s,torque_Nm,temperature_C,motor_angle_rad"
NOISE = (0.01, 0.03, 0.05, 0.005)  # V, A, rad/s, N m


def bench(seed, rate_hz, mean, seconds=12.0):
    """Rows of NAMES. Base values are 5 to 15 % from those of the simulator, as two motors of one kind differ."""
    draw = generator(seed, "sound motor bench")
    resistance, drop, constant, friction, load_friction, inertia = (
        value * (1.0 + draw.choice([-1.0, 1.0]) * draw.uniform(0.05, 0.15))
        for value in (1.3, 0.7, 0.018 * GEAR, 0.01, 0.0018 * GEAR, 1.6e-6 * GEAR**2)
    )
    count, per_sample = round(seconds / STEP_S), round(1.0 / rate_hz / STEP_S)
    time_s = np.arange(count) * STEP_S
    voltage = np.repeat(draw.choice([-6.0, -5.0, -3.0, 3.0, 5.0, 6.0], 40), count // 40)
    load = 0.25 * np.sin(2 * np.pi * 0.17 * time_s) + 0.15 * np.sin(2 * np.pi * 1.1 * time_s + 1.0)
    rows = np.empty((count, 4))
    speed = 0.0
    for at, (volts, outside) in enumerate(zip(voltage.tolist(), load.tolist(), strict=True)):
        left = volts - constant * speed
        current = 0.0 if abs(left) < drop else (left - np.sign(left) * drop) / resistance
        most = friction + load_friction * abs(current)
        drive = constant * current - outside - 0.0005 * speed
        sticks = speed == 0.0 and abs(drive) <= most
        held = drive if sticks else most * np.sign(speed or drive)
        change = (drive - held) / inertia
        rows[at] = volts, current, speed, outside
        following = speed + change * STEP_S
        speed = 0.0 if speed * following < 0.0 else following
    angle = np.cumsum(rows[:, 2]) * STEP_S * GEAR
    table = np.column_stack([rows, angle])
    whole = table[: count // per_sample * per_sample].reshape(-1, per_sample, 5)
    taken = whole.mean(axis=1) if mean else whole[:, 0]
    taken[:, :4] += draw.normal(size=(len(taken), 4)) * NOISE
    taken[:, 4] = np.round(taken[:, 4] / COUNT_RAD) * COUNT_RAD
    warm = np.full(len(taken), 22.0)
    return np.column_stack([np.arange(len(taken)) / rate_hz, taken[:, :4], warm, taken[:, 4]])


def diagnosis(train, holdout):
    return cli.main(["diagnose", str(train), "--holdout", str(holdout), "--experiment", "motor-bench", "--json", "-"])


@pytest.mark.parametrize(("seed", "rate_hz", "mean"), [(100, 500.0, False), (101, 250.0, False), (105, 500.0, True)])
def test_a_sound_bench_with_voltage_steps_raises_no_alarm(seed, rate_hz, mean, tmp_path, capfd):
    rows = bench(seed, rate_hz, mean)
    half = len(rows) // 2
    for name, part in (("train.csv", rows[:half]), ("holdout.csv", rows[half:])):
        np.savetxt(tmp_path / name, part, fmt="%.7g", delimiter=",", header=NAMES, comments="")
    assert diagnosis(tmp_path / "train.csv", tmp_path / "holdout.csv") == 0, capfd.readouterr().out


@pytest.mark.skipif(not DATA.is_dir(), reason="the recordings of an independent bench are not here")
@pytest.mark.parametrize("train, holdout", [("train", "holdout"), ("holdout", "train")])
def test_the_sound_recordings_of_an_independent_bench_raise_no_alarm(train, holdout, capfd):
    assert diagnosis(DATA / f"sound_bench_{train}.csv", DATA / f"sound_bench_{holdout}.csv") == 0, (
        capfd.readouterr().out
    )
