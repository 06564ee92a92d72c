"""Friction in a machine whose joints move each other: a cart with a hanging pole, integrated here by itself.

A force on the cart accelerates the pole as well, so that what is missing there is found only where the drive enters.
"""

import functools
import re

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import ModelError
from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.free_simulation import Joint, Output, SimulatedMachine, runge_kutta
from ranger_sim.sysid.machine import Known, Quantity
from ranger_sim.sysid.pipeline import diagnose

STEP_s, ROWS, FINER = 0.01, 2000, 20
MASS, FIRST, SECOND, CART, POLE = 6.0, 1.2, 0.6, 2.0, 0.4  # kg, kg m, kg m^2, N s/m, N m s


class Cart(SimulatedMachine):
    """[m, l c; l c, J] [a; alpha] = [force - b v + l s w^2; -d w - l g s]: first and second moment of the pole."""

    name = "cart"
    quantities = (
        Quantity("force_N", "N", "at the cart", drives=True),
        Quantity("way_m", "m", "of the cart"),
        Quantity("angle_rad", "rad", "of the pole, hanging"),
    )
    parameters = (
        Known("mass_kg", "kg", 5.0, 1.0, 100.0, "of both"),
        Known("first_kg_m", "kg m", 1.0, 0.1, 10.0, "moment of the pole"),
        Known("second_kg_m2", "kg m^2", 0.5, 0.05, 10.0, "moment of the pole"),
        Known("cart_Ns_per_m", "N s/m", 1.5, 0.0, 100.0, "damping"),
        Known("pole_Nms", "N m s", 0.5, 0.0, 100.0, "damping"),
    )
    states = ("way", "angle", "speed", "rate")
    outputs = (Output("way_m", "C", "mechanical", "m"), Output("angle_rad", "P", "mechanical", "rad"))
    joints = (Joint("speed", drive="force", slow=0.01), Joint("rate"))

    def inputs(self, table):
        return {"force": table["force_N"]}

    def first_guess(self, table):
        slopes = [signals.derivative(table, table[name], 2.0) for name in ("way_m", "angle_rad")]
        return {"way": table["way_m"], "angle": table["angle_rad"], "speed": slopes[0], "rate": slopes[1]}

    def rates(self, x, u, p):
        both = p["first_kg_m"] * np.cos(x["angle"])
        inward = p["first_kg_m"] * np.sin(x["angle"])
        pushed = u["force"] - p["cart_Ns_per_m"] * x["speed"] + inward * x["rate"] ** 2
        turned = -p["pole_Nms"] * x["rate"] - 9.81 * inward
        whole = p["mass_kg"] * p["second_kg_m2"] - both**2
        return {
            "way": x["speed"],
            "angle": x["rate"],
            "speed": (p["second_kg_m2"] * pushed - both * turned) / whole,
            "rate": (p["mass_kg"] * turned - both * pushed) / whole,
        }

    def step(self, x, u, p, step_s):
        return runge_kutta(self.rates, x, u, p, step_s)

    def observe(self, x, u, p):
        return {"way_m": x["way"], "angle_rad": x["angle"]}


@functools.cache
def pushed(seed, drag):
    """The cart with a drag, N s^2/m^2, that its model lacks; numpy solves the mass matrix in 20 parts of a row."""
    random = generator(seed, "cart and pole")
    hertz, phases = random.uniform(0.15, 0.9, 4), random.uniform(0.0, 6.28, 4)
    time_s = STEP_s * np.arange(ROWS)
    force = sum(4.0 * np.sin(2.0 * np.pi * f * time_s + phase) for f, phase in zip(hertz, phases, strict=True))
    x, v, rows = np.array([0.0, 0.05]), np.zeros(2), np.zeros((ROWS, 2))
    for k in range(ROWS * FINER):
        if k % FINER == 0:
            rows[k // FINER] = x
        before, after = force[k // FINER], force[min(k // FINER + 1, ROWS - 1)]
        here = before + ((k % FINER + 0.5) / FINER) * (after - before)
        c, s = FIRST * np.cos(x[1]), FIRST * np.sin(x[1])
        torques = [here - CART * v[0] - drag * v[0] * abs(v[0]) + s * v[1] ** 2, -POLE * v[1] - 9.81 * s]
        v = v + np.linalg.solve([[MASS, c], [c, SECOND]], torques) * STEP_s / FINER
        x = x + v * STEP_s / FINER
    shown = rows + 2e-4 * random.normal(size=rows.shape)
    columns = {"force_N": force, "way_m": shown[:, 0], "angle_rad": shown[:, 1]}
    return Table(time_s, columns, (slice(0, ROWS),), f"cart {seed}", {})


def test_a_drag_of_the_cart_is_found_in_the_force_that_drives_it():
    result = diagnose(Cart(), [pushed(3, 1.5)], [pushed(4, 1.5)]).result
    (found,) = result.causes
    assert (found.name, found.at) == ("drag", "speed")
    size = found.parameters["quadratic_torque_s2"]
    assert size.ci95[0] < 1.5 < size.ci95[1] and size.ci95[1] - size.ci95[0] < 0.3
    assert result.gain.fraction_of_achievable > 0.95


def test_the_sound_cart_has_no_cause():
    assert not diagnose(Cart(), [pushed(5, 0.0)], [pushed(6, 0.0)]).result.detected


def test_a_joint_driven_by_no_input_is_refused():
    class Other(Cart):
        joints = (Joint("speed", drive="push"),)

    with pytest.raises(ModelError, match=re.escape("cart: joint speed is driven by push; inputs are force")):
        diagnose(Other(), [pushed(5, 0.0)])


def test_a_joint_has_an_inertia_or_a_drive():
    with pytest.raises(ModelError, match=r"joint speed: it has the inertia 2\.0 and the drive force; one will do"):
        Joint("speed", inertia=2.0, drive="force")
