"""A pendulum that swings up, as a user's simulator without gravity: gravity is named, no absurd inertia is fitted."""

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.free_simulation import Joint, Output, SimulatedMachine, runge_kutta, standing
from ranger_sim.sysid.free_simulation.fit import TrajectoryFit
from ranger_sim.sysid.machine import Known, Quantity
from ranger_sim.sysid.pipeline import diagnose

INERTIA, VISCOUS, COULOMB, WEIGHT = 0.16, 0.06, 0.15, 2.9  # kg m^2, N m s, N m, N m
STEP_s, ROWS, FINER = 0.004, 1500, 16


class Pendulum(SimulatedMachine):
    """I a = torque - b w - c sgn w, and no gravity."""

    name = "pendulum"
    weight_Nm = 0.0
    quantities = (
        Quantity("position_rad", "rad", "from hanging"),
        Quantity("velocity_rad_per_s", "rad/s", "of the pendulum"),
        Quantity("torque_Nm", "N m", "of the motor", drives=True),
    )
    parameters = (
        Known("inertia_kg_m2", "kg m^2", 0.1, 0.001, 1e4, "of the pendulum"),
        Known("viscous_Nms", "N m s", 0.05, 0.0, 1e3, "of the gear"),
        Known("coulomb_Nm", "N m", 0.2, 0.0, 1e3, "of the gear"),
    )
    states = ("angle", "rate")
    outputs = (
        Output("position_rad", "M", "mechanical", "rad"),
        Output("velocity_rad_per_s", "M", "mechanical", "rad/s"),
    )
    joints = (Joint("rate", inertia="inertia_kg_m2", position="angle"),)

    def inputs(self, table):
        return {"torque": table["torque_Nm"]}

    def first_guess(self, table):
        angle = table["position_rad"]
        return {"angle": angle, "rate": signals.derivative(table, angle, 5.0)}

    def rates(self, x, u, p):
        rubs = p["viscous_Nms"] * x["rate"] + p["coulomb_Nm"] * np.tanh(x["rate"] / 0.05)
        pulls = self.weight_Nm * np.sin(x["angle"])
        return {"angle": x["rate"], "rate": (u["torque"] - rubs - pulls) / p["inertia_kg_m2"]}

    def step(self, x, u, p, step_s):
        return runge_kutta(self.rates, x, u, p, step_s)

    def observe(self, x, u, p):
        return {"position_rad": x["angle"], "velocity_rad_per_s": x["rate"]}

    def loose(self, x, u, p, step_s):
        return {"rate": standing(x["rate"], p["coulomb_Nm"], 0.05, step_s) / p["inertia_kg_m2"]}


def swung_up(seed):
    """A torque that pumps energy in until it is near the top; 0.25 ms steps, 4 ms rows, counts of 1.5 mrad."""
    random = generator(seed, "swing up")
    angle, rate, rows = 0.0, 0.0, np.zeros((ROWS, 3))
    torque = 0.0
    for k in range(ROWS * FINER):
        if k % FINER == 0:
            energy = 0.5 * INERTIA * rate**2 - WEIGHT * np.cos(angle)
            torque = 1.0 * np.sign(rate or 1.0) if energy < 0.8 * WEIGHT else -0.5 * np.sign(rate)
            torque += 0.2 * random.normal()
            rows[k // FINER] = angle, rate, torque
        drive = torque - VISCOUS * rate - WEIGHT * np.sin(angle)
        following = rate + (drive - COULOMB * np.sign(rate)) / INERTIA * STEP_s / FINER
        rate = 0.0 if rate * following < 0.0 and abs(drive) < COULOMB else following
        angle += rate * STEP_s / FINER
    position = np.round(rows[:, 0] / 0.0015) * 0.0015
    columns = {
        "position_rad": position,
        "velocity_rad_per_s": rows[:, 1] + 0.14 * random.normal(size=ROWS),
        "torque_Nm": rows[:, 2],
    }
    return Table(STEP_s * np.arange(ROWS), columns, (slice(0, ROWS),), f"swing-up {seed}", {"position_rad": 0.0015})


def test_a_fit_along_the_measurement_that_ends_less_likely_is_not_kept(monkeypatch):
    settled = TrajectoryFit._settled

    def never_done(self, rounds):
        settled(self, rounds)
        return False

    def absurd(self):
        self.p = np.array([503.0, 0.05, 426.0])

    machine = Pendulum()
    machine.weight_Nm = WEIGHT
    fit = TrajectoryFit(machine, swung_up(1))
    monkeypatch.setattr(TrajectoryFit, "_settled", never_done)
    monkeypatch.setattr(TrajectoryFit, "_follow", absurd)
    fit.settle(follow=True)
    assert fit.p[0] == pytest.approx(INERTIA, rel=0.1) and fit.p[2] == pytest.approx(COULOMB, rel=0.1)


def test_gravity_that_the_model_lacks_is_named_in_a_swing_up():
    found = diagnose(Pendulum(), [swung_up(1)], [swung_up(2)]).result
    assert [each.name for each in found.causes][:1] == ["once_per_turn"]
    value = found.causes[0].parameters["sine_torque"].value
    assert value == pytest.approx(-WEIGHT, rel=0.1)
    assert found.evidence.parameters["inertia_kg_m2"].value == pytest.approx(INERTIA, rel=0.1)
    assert found.gain is not None and found.gain.fraction_of_achievable > 0.9
