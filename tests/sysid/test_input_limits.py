"""Inputs that saturate or have a dead zone at any part of their range: the limit is found wherever it is.

The pendulum is integrated here in 40 steps a row, semi-implicitly as gymnasium's is, without anything of the diagnosis.
"""

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.free_simulation import Joint, Output, SimulatedMachine, runge_kutta
from ranger_sim.sysid.machine import Known, Quantity
from ranger_sim.sysid.pipeline import diagnose

STEP_s, ROWS, FINER = 0.01, 2000, 40
INERTIA, DAMPING, WEIGHT, TOP_Nm = 0.5, 0.3, 4.905, 4.0


class Pendulum(SimulatedMachine):
    """I a = torque - b w - m g l sin(angle)."""

    name = "pendulum"
    quantities = (
        Quantity("torque_Nm", "N m", "of the motor", drives=True),
        Quantity("angle_rad", "rad", "from hanging"),
        Quantity("rate_rad_per_s", "rad/s", "of the angle"),
    )
    parameters = (
        Known("inertia_kg_m2", "kg m^2", 0.4, 0.01, 100.0, ""),
        Known("damping_Nms", "N m s", 0.2, 0.0, 100.0, ""),
        Known("weight_Nm", "N m", 4.0, 0.0, 1e3, ""),
    )
    states = ("angle", "rate")
    outputs = (Output("angle_rad", "M", "mechanical", "rad"), Output("rate_rad_per_s", "M", "mechanical", "rad/s"))
    joints = (Joint("rate", inertia="inertia_kg_m2", position="angle"),)

    def inputs(self, table):
        return {"torque": table["torque_Nm"]}

    def first_guess(self, table):
        return {"angle": table["angle_rad"], "rate": table["rate_rad_per_s"]}

    def rates(self, x, u, p):
        pulls = p["damping_Nms"] * x["rate"] + p["weight_Nm"] * np.sin(x["angle"])
        return {"angle": x["rate"], "rate": (u["torque"] - pulls) / p["inertia_kg_m2"]}

    def step(self, x, u, p, step_s):
        return runge_kutta(self.rates, x, u, p, step_s)

    def observe(self, x, u, p):
        return {"angle_rad": x["angle"], "rate_rad_per_s": x["rate"]}


def swung(seed, bend):
    """A sum of five waves of at most 4 N m as the torque, of which the pendulum gets bend(torque)."""
    random = generator(seed, "limits of an input")
    hertz, sizes, phases = random.uniform(0.2, 1.5, 5), random.uniform(0.5, 1.0, 5), random.uniform(0.0, 6.28, 5)
    fine_s = STEP_s / FINER * np.arange(ROWS * FINER)
    torque = sum(
        size * np.sin(2.0 * np.pi * f * fine_s + phase) for size, f, phase in zip(sizes, hertz, phases, strict=True)
    )
    torque *= TOP_Nm / np.max(np.abs(torque))
    gets = bend(torque).tolist()
    angle, rate, rows = 0.1, 0.0, np.zeros((ROWS, 2))
    for k in range(ROWS * FINER):
        if k % FINER == 0:
            rows[k // FINER] = angle, rate
        rate += (gets[k] - DAMPING * rate - WEIGHT * np.sin(angle)) / INERTIA * STEP_s / FINER
        angle += rate * STEP_s / FINER
    columns = {
        "torque_Nm": torque[::FINER],
        "angle_rad": rows[:, 0] + 0.002 * random.normal(size=ROWS),
        "rate_rad_per_s": rows[:, 1] + 0.01 * random.normal(size=ROWS),
    }
    return Table(STEP_s * np.arange(ROWS), columns, (slice(0, ROWS),), f"swung {seed}", {})


CASES = {
    "saturation": lambda limit: lambda u: np.clip(u, -limit, limit),
    "dead_zone": lambda limit: lambda u: u - np.clip(u, -limit, limit),
}


@pytest.mark.parametrize(("cause", "limit"), [("saturation", 0.6), ("saturation", 3.3), ("dead_zone", 0.9)])
def test_a_limit_is_found_below_the_inputs_median_and_near_its_top(cause, limit):
    """Steps of the grid are a sixth of a limit and more; a share is wrong with its limit. Noise alone moves the share
    of 3.3, which 2 % of the rows exceed, by a hundredth."""
    bend = CASES[cause](limit)
    result = diagnose(Pendulum(), [swung(13, bend)], [swung(14, bend)]).result
    (found,) = result.causes
    assert (found.name, found.at) == (cause, "torque")
    assert found.parameters["share"].value == pytest.approx(1.0, abs=0.02)
    assert found.parameters["limit"].value == pytest.approx(limit, rel=0.01)
    assert result.gain.fraction_of_achievable > 0.95


def test_an_input_without_limits_has_none():
    result = diagnose(Pendulum(), [swung(15, lambda u: u)], [swung(16, lambda u: u)]).result
    assert not result.detected and result.causes == ()
