"""Three machines as docs/diagnose-your-machine.md has a user write them: equations, channels, parameters."""

from typing import ClassVar

import numpy as np

from ranger_sim.sysid import signals
from ranger_sim.sysid.free_simulation import Joint, Output, Port, SimulatedMachine, Term, runge_kutta
from ranger_sim.sysid.machine import Known, Quantity


class ThrustStand(SimulatedMachine):
    """J w' = k i - b w - c w^2, i = (V - k w) / R, thrust = ct w^2; J was weighed."""

    name = "thrust-stand"
    quantities = (
        Quantity("voltage_V", "V", "at the motor"),
        Quantity("thrust_N", "N", "by the load cell"),
        Quantity("speed_rad_per_s", "rad/s", "of the propeller"),
        Quantity("current_A", "A", "of the motor"),
    )
    parameters = (
        Known("k", "N m/A", 0.01, 0.001, 0.1, "torque constant"),
        Known("R", "ohm", 0.16, 0.01, 2.0, "of the winding"),
        Known("b", "1e-5 N m s", 3.0, 0.0, 100.0, "of the bearing"),
        Known("c", "1e-7 N m s^2", 1.3, 0.01, 10.0, "of the propeller"),
        Known("ct", "1e-6 N s^2", 7.0, 0.1, 100.0, "of the propeller"),
    )
    states = ("w",)
    outputs = (
        Output("speed_rad_per_s", "M", "mechanical", "rad/s"),
        Output("thrust_N", "S", "sensor", "N"),
        Output("current_A", "E", "electrical", "A"),
    )
    joints = (Joint("w", inertia=4.2e-5),)
    ports = (Port("lost_V", "V", "electrical"),)

    def inputs(self, table):
        return {"V": table["voltage_V"]}

    def first_guess(self, table):
        return {"w": table["speed_rad_per_s"]}

    def current(self, x, u, p):
        return (u["V"] - u["lost_V"] - p["k"] * x["w"]) / p["R"]

    def rates(self, x, u, p):
        torque = p["k"] * self.current(x, u, p) - 1e-5 * p["b"] * x["w"] - 1e-7 * p["c"] * x["w"] ** 2
        return {"w": torque / 4.2e-5}

    def step(self, x, u, p, step_s):
        return runge_kutta(self.rates, x, u, p, step_s)

    def observe(self, x, u, p):
        thrust = 1e-6 * p["ct"] * x["w"] ** 2
        return {"speed_rad_per_s": x["w"], "thrust_N": thrust, "current_A": self.current(x, u, p)}

    def terms(self, recordings):
        """What only this machine has: a winding that warms up."""

        def heat(s, tau_s):
            step_s, warm, current = s["t"][1] - s["t"][0], [0.0], s["current_A"]
            for square in (current[:-1] ** 2).tolist():
                warm.append(warm[-1] + step_s * (square - warm[-1]) / tau_s)
            return {"lost_V": warm * current}

        grid = [{"tau_s": tau_s} for tau_s in (2.0, 4.0, 8.0, 16.0, 50.0)]
        return [
            Term("resistance_heating", "winding", "electrical", ("ohm_per_A2",),
                 lambda r, shape, values: heat(r.signals, shape["tau_s"]), grid),
        ]  # fmt: skip


class HeatedRod(SimulatedMachine):
    """C1 T1' = P - k (T1 - T2) - h1 (T1 - 22), C2 T2' = k (T1 - T2) - h2 (T2 - 22)."""

    name = "heated-rod"
    quantities = (
        Quantity("heater_W", "W", "electrical", drives=True),
        Quantity("hot_C", "C", "of the heated end"),
        Quantity("cold_C", "C", "of the other end"),
    )
    parameters = (
        Known("C1", "J/K", 170.0, 1.0, 1e4, "of the hot end"),
        Known("C2", "J/K", 200.0, 1.0, 1e4, "of the cold end"),
        Known("k", "W/K", 1.4, 0.01, 100.0, "through the rod"),
        Known("h1", "W/K", 0.3, 0.0, 100.0, "to the air"),
        Known("h2", "W/K", 0.3, 0.0, 100.0, "to the air"),
    )
    states = ("T1", "T2")
    outputs = (Output("hot_C", "M", "thermal", "C"), Output("cold_C", "T", "thermal", "C"))
    ports = (Port("heat_W", "W", "thermal"),)

    def inputs(self, table):
        return {"P": table["heater_W"]}

    def first_guess(self, table):
        return {"T1": table["hot_C"], "T2": table["cold_C"]}

    def rates(self, x, u, p):
        through = p["k"] * (x["T1"] - x["T2"])
        given = u["P"] + u["heat_W"] - through - p["h1"] * (x["T1"] - 22.0)
        return {"T1": given / p["C1"], "T2": (through - p["h2"] * (x["T2"] - 22.0)) / p["C2"]}

    def step(self, x, u, p, step_s):
        return runge_kutta(self.rates, x, u, p, step_s)

    def observe(self, x, u, p):
        return {"hot_C": x["T1"], "cold_C": x["T2"]}

    def terms(self, recordings):
        def radiated(r, shape, values):
            return {"heat_W": -1e-9 * ((r.signals["T1"] + 273.15) ** 4 - 295.15**4)}

        return [Term("radiation", "hot end", "thermal", ("nW_per_K4",), radiated)]


class ElasticJoint(SimulatedMachine):
    """A motor of 0.02 kg m^2 turns a link through a compliant gear."""

    name = "elastic-joint"
    quantities = (
        Quantity("torque_Nm", "N m", "of the motor", drives=True),
        Quantity("motor_rad", "rad", "of the motor"),
        Quantity("link_rad", "rad", "of the link"),
    )
    parameters = (
        Known("Jl", "kg m^2", 0.1, 0.001, 10.0, "of the link"),
        Known("K", "N m/rad", 150.0, 1.0, 1e4, "of the gear"),
        Known("D", "N m s/rad", 0.1, 0.0, 10.0, "of the gear"),
        Known("bm", "N m s", 0.1, 0.0, 10.0, "of the motor"),
        Known("bl", "N m s", 0.05, 0.0, 10.0, "of the link"),
    )
    states = ("motor", "link", "motor_rate", "link_rate")
    outputs = (Output("motor_rad", "M", "mechanical", "rad"), Output("link_rad", "T", "mechanical", "rad"))
    joints = (Joint("motor_rate", inertia=0.02), Joint("link_rate", inertia="Jl", position="link"))
    ports = (Port("gear_Nm", "N m", "transmission"),)

    def inputs(self, table):
        return {"u": table["torque_Nm"]}

    def first_guess(self, table):
        motor, link = table["motor_rad"], table["link_rad"]
        slopes = (signals.derivative(table, each, 0.02 / table.step_s) for each in (motor, link))
        return dict(zip(self.states, (motor, link, *slopes), strict=True))

    def rates(self, x, u, p):
        through = p["K"] * (x["motor"] - x["link"]) + p["D"] * (x["motor_rate"] - x["link_rate"]) + u["gear_Nm"]
        return {
            "motor": x["motor_rate"],
            "link": x["link_rate"],
            "motor_rate": (u["u"] - through - p["bm"] * x["motor_rate"]) / 0.02,
            "link_rate": (through - p["bl"] * x["link_rate"]) / p["Jl"],
        }

    def step(self, x, u, p, step_s):
        return runge_kutta(self.rates, x, u, p, step_s)

    def observe(self, x, u, p):
        return {"motor_rad": x["motor"], "link_rad": x["link"]}

    def terms(self, recordings):
        def cubed(r, shape, values):
            return {"gear_Nm": (r.signals["motor"] - r.signals["link"]) ** 3}

        return [Term("stiffening", "gear", "transmission", ("Nm_per_rad3",), cubed)]


class LoggedStand(ThrustStand):
    """The same stand; its voltage is shown in counts of 5 mV."""

    noisy_inputs: ClassVar = {"V": 0.0042}


class LoggedJoint(ElasticJoint):
    """The same joint; its torque is shown in counts of 0.01 N m."""

    noisy_inputs: ClassVar = {"u": 0.0058}


class Battery(SimulatedMachine):
    """E' = -slope i, v1' = (R1 i - v1) / tau; the voltage is E - R0 i - v1."""

    name = "battery"
    quantities = (
        Quantity("current_A", "A", "out of the battery", drives=True),
        Quantity("voltage_V", "V", "at the clamps", drives=False),
    )
    parameters = (
        Known("R0", "ohm", 0.02, 0.001, 1.0, "at once"),
        Known("R1", "ohm", 0.02, 0.001, 1.0, "after a while"),
        Known("tau", "s", 20.0, 1.0, 500.0, "of R1"),
        Known("slope", "V/(A s)", 5e-5, 0.0, 1.0, "of the voltage without current, per charge"),
    )
    states = ("E", "v1")
    outputs = (Output("voltage_V", "E", "electrical", "V"),)
    ports = (Port("lost_V", "V", "electrical"),)
    noisy_inputs: ClassVar = {"i": 0.0042}

    def inputs(self, table):
        return {"i": table["current_A"]}

    def first_guess(self, table):
        return {"E": table["voltage_V"], "v1": np.zeros(len(table))}

    def rates(self, x, u, p):
        return {"E": -p["slope"] * u["i"], "v1": (p["R1"] * u["i"] - x["v1"]) / p["tau"]}

    def step(self, x, u, p, step_s):
        return runge_kutta(self.rates, x, u, p, step_s)

    def observe(self, x, u, p):
        return {"voltage_V": x["E"] - p["R0"] * u["i"] - x["v1"] - u["lost_V"]}

    def terms(self, recordings):
        def grown(r, shape, values):
            return {"lost_V": r.signals["t"] * r.signals["i"]}

        return [Term("resistance_growth", "cell", "electrical", ("ohm_per_s",), grown)]
