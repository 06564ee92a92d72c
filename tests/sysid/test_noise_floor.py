"""Nothing is called sound that leaves far more than its channels' noise: the number for it, and the command's code."""

import json

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid import noise_floor
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.free_simulation import Joint, Output, SimulatedMachine, runge_kutta
from ranger_sim.sysid.machine import Equation, Known, Quantity, Recording
from ranger_sim.sysid.regression import Regression
from ranger_sim.tools import cli

STEP_s, NOISE = 0.01, 0.05


class Disc(SimulatedMachine):
    """w' = gain V - damping w."""

    name = "disc"
    quantities = (Quantity("voltage_V", "V", "at the motor"), Quantity("speed_rad_per_s", "rad/s", "of the disc"))
    parameters = (Known("gain", "rad/s^2/V", 4.5, 0.0, 1e3, "of the motor"), Known("damping", "1/s", 1.1, 0.0, 1e3, ""))
    states = ("speed",)
    outputs = (Output("speed_rad_per_s", "M", "mechanical", "rad/s"),)
    joints = (Joint("speed"),)

    def inputs(self, table):
        return {"voltage": table["voltage_V"]}

    def first_guess(self, table):
        return {"speed": table["speed_rad_per_s"]}

    def rates(self, x, u, p):
        return {"speed": p["gain"] * u["voltage"] - p["damping"] * x["speed"]}

    def step(self, x, u, p, step_s):
        return runge_kutta(self.rates, x, u, p, step_s)

    def observe(self, x, u, p):
        return {"speed_rad_per_s": x["speed"]}


def spun(seed, load=0.0, rows=1500):
    """A disc on a voltage held for 0.4 s at a time, in closed form; a hand brakes it from 5 to 8 s by `load`."""
    random = generator(seed, "noise floor")
    voltage = np.repeat(random.uniform(-6.0, 6.0, rows // 40 + 1), 40)[:rows]
    time_s = STEP_s * np.arange(rows)
    pushed = 5.0 * voltage - load * ((time_s >= 5.0) & (time_s < 8.0))
    keeps, speed = np.exp(-STEP_s), np.zeros(rows)
    for k in range(rows - 1):
        speed[k + 1] = keeps * speed[k] + (1.0 - keeps) * pushed[k]
    measured = speed + NOISE * random.normal(size=rows)
    return np.column_stack([time_s, voltage, measured])


def diagnosed(tmp_path, capfd, *loads):
    """(code, answer) of the command; of several runs the last is held out."""
    paths = []
    for number, load in enumerate(loads):
        paths.append(tmp_path / f"run{number}.csv")
        np.savetxt(paths[-1], spun(number, load), "%.9g", ",", header="time_s,voltage_V,speed_rad_per_s", comments="")
    held = ["--holdout", str(paths[-1])] if len(paths) > 1 else []
    command = ["diagnose", str(paths[0]), *held, "--experiment", "tests.sysid.test_noise_floor:Disc"]
    code = cli.main([*command, "--json", "-"])
    answer = json.loads(capfd.readouterr().out)
    cli.main(command)
    return code, answer, capfd.readouterr().out


def test_a_held_out_error_far_above_the_noise_is_code_3_and_names_equation_error_and_noise(tmp_path, capfd):
    code, answer, text = diagnosed(tmp_path, capfd, 0.0, 12.0)
    floor = answer["evidence"]["noise_floor"]["speed_rad_per_s"]
    assert (code, answer["detected"], floor["held_out"]) == (3, False, True)
    # the brake takes up to 11 rad/s for 3 of 15 s; its windows of 2 s start free, each at the most probable state
    # a sensor's noise may be taken for up to twice what its channel shows, where the model does not follow it
    assert 0.5 < floor["left"] < 5.0 and NOISE < floor["channel"] < 3.0 * NOISE
    assert "the speed_rad_per_s equation leaves" in text and "rad/s of the held-out data" in text


@pytest.mark.parametrize("loads", [(0.0,), (0.0, 0.0)])
def test_a_sound_disc_leaves_its_noise_and_is_code_0(loads, tmp_path, capfd):
    code, answer, _ = diagnosed(tmp_path, capfd, *loads)
    floor = answer["evidence"]["noise_floor"]["speed_rad_per_s"]
    assert (code, answer["evidence"]["above_noise_floor"]) == (0, [])
    assert floor["left"] == pytest.approx(floor["channel"], rel=0.2)


def recorded(residual, **more):
    rows = len(residual)
    table = Table(0.01 * np.arange(rows), {}, (slice(0, rows),), "run", {})
    ones = np.ones(rows)
    equation = Equation("legs", "M", "mechanical", "N m", residual, {"offset": ones}, ones > 0.0)
    return Recording(table, {}, {"legs": equation}, noise_by_candidates=False, **more)


def test_repeats_give_the_noise_however_large_the_model_s_error():
    random = generator(4, "noise floor")
    stride = np.tile(np.sin(2.0 * np.pi * np.arange(50) / 50.0), 40)  # rms 0.707 in every stride
    places = np.tile(np.arange(50), 40)
    made = recorded(stride + 0.1 * random.normal(size=2000), whitened=False, repeats={"legs": places})
    floor = noise_floor.by_band_or_repeats(Regression([made]))["legs"]
    assert floor.left == pytest.approx(np.hypot(np.sqrt(0.5), 0.1), rel=0.02)
    assert floor.channel == pytest.approx(0.1, rel=0.05) and noise_floor.far(floor)


def test_the_band_above_the_machine_s_motion_gives_the_noise_below_it_too():
    random = generator(5, "noise floor")
    slow = np.sin(2.0 * np.pi * 0.004 * np.arange(4000))
    made = recorded(slow + 0.1 * random.normal(size=4000), noise_above=0.1)
    floor = noise_floor.by_band_or_repeats(Regression([made]))["legs"]
    assert floor.channel == pytest.approx(0.1, rel=0.1) and noise_floor.far(floor)


def with_a_column(noise, misfit=0.0, memory=0.0):
    """An equation whose response is exact; its one column, of coefficient 3, has the noise. misfit: a slow one."""
    random = generator(7, "noise floor")
    rows = 4000
    time = np.arange(rows)
    shocks, error = noise * np.sqrt(1.0 - memory**2) * random.normal(size=rows), np.zeros(rows)
    for row in range(1, rows):
        error[row] = memory * error[row - 1] + shocks[row]
    true = np.sin(0.02 * time) + np.sin(0.0411 * time)
    table = Table(0.01 * time, {}, (slice(0, rows),), "run", {})
    response = 3.0 * true + misfit * np.sin(0.0071 * time)
    equation = Equation("force", "M", "mechanical", "N", response, {"slope": true + error}, time >= 0)
    return noise_floor.by_channels(Regression([Recording(table, {}, {"force": equation})]))["force"]


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_noise_of_a_column_and_noise_with_a_memory_are_of_the_floor(memory):
    """A differentiated encoder is in the columns: the response alone has shown sound axes 5 to 1e12 times above it."""
    floor = with_a_column(0.01, memory=memory)
    assert floor.left == pytest.approx(0.03, rel=0.1)
    # the memory is the upper limit of what the fast part shows, which has more slow noise than the likeliest one
    assert 0.03 / 1.1 < floor.channel < 0.03 * 2.2 and not noise_floor.far(floor)


def test_what_is_slow_and_not_of_the_noise_is_far_above_the_floor():
    floor = with_a_column(0.01, misfit=0.5)
    assert floor.left == pytest.approx(0.5 * np.sqrt(0.5), rel=0.1)
    assert floor.channel == pytest.approx(0.03, rel=0.1) and noise_floor.far(floor)


def test_nothing_is_concluded_where_no_noise_is_known():
    made = recorded(generator(6, "noise floor").normal(size=2000), whitened=False)
    assert noise_floor.by_band_or_repeats(Regression([made])) == {}
