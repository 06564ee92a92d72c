"""The matrix's belt axis as docs/diagnose-your-machine.md has a user write it."""

import numpy as np

from ranger_sim.sysid import signals
from ranger_sim.sysid.free_simulation import Joint, Output, SimulatedMachine, runge_kutta, standing
from ranger_sim.sysid.machine import Known, Quantity

SLOW_M_PER_S = 0.002
TURN_M = 0.08


class BeltAxis(SimulatedMachine):
    """6 kg on a belt; voltage, current and position are logged."""

    name = "belt-axis"
    quantities = (
        Quantity("voltage_V", "V", "at the motor"),
        Quantity("current_A", "A", "of the motor"),
        Quantity("position_m", "m", "of the carriage"),
    )
    parameters = (
        Known("force_N_per_A", "N/A", 20.0, 0.1, 1000.0, "of motor and pulley"),
        Known("resistance_ohm", "ohm", 1.5, 0.01, 100.0, "of the winding"),
        Known("viscous_Ns_per_m", "N s/m", 12.0, 0.0, 1000.0, "of the guide"),
        Known("coulomb_N", "N", 8.0, 0.0, 300.0, "of the guide"),
    )
    states = ("x", "v")
    outputs = (Output("position_m", "M", "mechanical", "m"), Output("current_A", "E", "electrical", "A"))
    noisy_inputs = {"V": None}  # noqa: RUF012
    joints = (Joint("v", inertia=6.0, position="x", turns=2.0 * np.pi / TURN_M, slow=SLOW_M_PER_S),)

    def inputs(self, table):
        return {"V": table["voltage_V"]}

    def first_guess(self, table):
        width = 0.02 / table.step_s
        x = table["position_m"]
        return {"x": signals.smooth(table, x, width), "v": signals.derivative(table, x, width)}

    def current(self, x, u, p):
        return (u["V"] - p["force_N_per_A"] * x["v"]) / p["resistance_ohm"]

    def rates(self, x, u, p):
        force = p["force_N_per_A"] * self.current(x, u, p) - p["viscous_Ns_per_m"] * x["v"]
        return {"x": x["v"], "v": (force - p["coulomb_N"] * np.tanh(x["v"] / SLOW_M_PER_S)) / 6.0}

    def step(self, x, u, p, step_s):
        return runge_kutta(self.rates, x, u, p, step_s)

    def loose(self, x, u, p, step_s):
        return {"v": standing(x["v"], p["coulomb_N"], SLOW_M_PER_S, step_s) / 6.0}

    def observe(self, x, u, p):
        return {"position_m": x["x"], "current_A": self.current(x, u, p)}


class HeldBeltAxis(BeltAxis):
    """Its voltage is set once a row, which the user knows."""

    held_inputs = ("V",)
