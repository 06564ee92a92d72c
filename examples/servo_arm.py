"""A machine of your own, complete: an arm on a geared servo motor, lifted against its weight.

    J q'' = k V - d q' - C tanh(q'/0.02) - m g l sin q          q from hanging, V at the motor

The supply's voltage and the arm's angle are logged, nothing else; no derivative of either is taken. m g l is known: the
arm was weighed. Without one known torque nothing here has a scale. Diagnose a log of yours with

    ranger-sim diagnose monday.csv --holdout tuesday.csv --experiment examples.servo_arm:ServoArm
"""

import numpy as np

from ranger_sim.sysid import signals
from ranger_sim.sysid.free_simulation import Output, Port, SimulatedMachine, Term, runge_kutta, standing
from ranger_sim.sysid.machine import Known, Quantity

WEIGHT_NM = 1.6  # m g l
GEAR = 50.0


class ServoArm(SimulatedMachine):
    """What the diagnosis must know of the arm. Copy it and write your own machine's lines."""

    name = "servo-arm"
    # The log's columns beside t_s
    quantities = (
        Quantity("voltage_V", "V", "at the servo"),
        Quantity("angle_rad", "rad", "of the arm, 0 where it hangs"),
    )
    # Start values, and limits beyond which no such machine is; what divides has a lower limit above 0
    parameters = (
        Known("inertia_kg_m2", "kg m^2", 0.05, 0.001, 10.0, "of arm and rotor about the axis"),
        Known("torque_Nm_per_V", "N m/V", 0.4, 0.0, 100.0, "stall torque per volt"),
        Known("damping_Nms", "N m s/rad", 0.3, 0.0, 100.0, "back-EMF and oil"),
        Known("friction_Nm", "N m", 0.1, 0.0, 10.0, "of the gearbox"),
    )
    states = ("angle", "rate")
    outputs = (Output("angle_rad", letter="M", subsystem="mechanical", unit="rad"),)
    # The voltage's noise drives the arm as the voltage does. None: found in the channel itself
    noisy_inputs = {"voltage": None}  # noqa: RUF012
    # Where something that the equations lack can enter
    ports = (
        Port("torque_Nm", "N m", "mechanical"),
        Port("lost_V", "V", "electrical"),
        Port("angle_error_rad", "rad", "sensor"),
    )

    def inputs(self, table):
        return {"voltage": table["voltage_V"]}

    def first_guess(self, table):
        width = 0.02 / table.step_s
        angle = table["angle_rad"]
        return {"angle": signals.smooth(table, angle, width), "rate": signals.derivative(table, angle, width)}

    def rates(self, x, u, p):
        """The differential equation."""
        torque = p["torque_Nm_per_V"] * (u["voltage"] - u["lost_V"]) + u["torque_Nm"]
        torque = torque - p["damping_Nms"] * x["rate"] - p["friction_Nm"] * np.tanh(x["rate"] / 0.02)
        return {"angle": x["rate"], "rate": (torque - WEIGHT_NM * np.sin(x["angle"])) / p["inertia_kg_m2"]}

    def step(self, x, u, p, step_s):
        return runge_kutta(self.rates, x, u, p, step_s)

    def loose(self, x, u, p, step_s):
        """Where the arm stands, its friction takes what comes: nothing is concluded from its torque there."""
        return {"rate": standing(x["rate"], p["friction_Nm"], 0.02, step_s) / p["inertia_kg_m2"]}

    def observe(self, x, u, p):
        return {"angle_rad": x["angle"] + u["angle_error_rad"]}

    def terms(self, recordings):
        """What could be wrong: a name, a place, and what it puts into a port along the fitted trajectory `s`."""

        def torque(make):
            return lambda r, shape, values: {"torque_Nm": make(r.signals, shape)}

        def turning(s, shape):
            angle = shape["periods"] * GEAR * s["angle"]
            return np.column_stack((np.cos(angle), np.sin(angle)))

        speeds = [{"speed_rad_s": speed} for speed in (0.1, 0.2, 0.5, 1.0)]
        return [
            Term("cable_spring", "arm", "mechanical", ("Nm_per_rad",), torque(lambda s, _: -s["angle"])),
            Term("drag", "arm", "mechanical", ("quadratic_Nms2",), torque(lambda s, _: -s["rate"] * np.abs(s["rate"]))),
            Term("stribeck", "gearbox", "mechanical", ("excess_Nm",),
                 torque(lambda s, p: -np.tanh(s["rate"] / 0.02) * np.exp(-((s["rate"] / p["speed_rad_s"]) ** 2))),
                 speeds, lambda found: found["excess_Nm"] > 0.0),
            Term("cogging", "motor", "mechanical", ("cosine_Nm", "sine_Nm"), torque(turning),
                 [{"periods": n} for n in (1.0, 2.0, 3.0, 4.0)], phase_is_free=True),
            Term("supply_sag", "supply", "electrical", ("per_V",),
                 lambda r, shape, values: {"lost_V": r.signals["voltage"] * np.abs(r.signals["voltage"])}),
            Term("sensor_offset", "angle_rad", "sensor", ("offset_rad",),
                 lambda r, shape, values: {"angle_error_rad": np.ones_like(r.signals["angle"])}),
        ]  # fmt: skip
