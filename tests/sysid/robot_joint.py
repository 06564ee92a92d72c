"""A joint of a robot arm as a user writes it; and with its gravity, which otherwise is a candidate."""

import numpy as np

from ranger_sim.sysid.balance import Balance
from ranger_sim.sysid.machine import Known, Quantity


class Joint(Balance):
    name = "robot-joint"
    quantities = (
        Quantity("angle_rad", "rad", "of the joint"),
        Quantity("rate_rad_per_s", "rad/s", "of the joint"),
        Quantity("current_A", "A", "of the motor", drives=False),
    )
    parameters = (
        Known("inertia_As2_per_rad", "A s^2/rad", 0.1, 0.0, 100.0, "of the joint, in current"),
        Known("viscous_As_per_rad", "A s/rad", 1.0, 0.0, 100.0, "friction"),
        Known("coulomb_A", "A", 0.5, 0.0, 50.0, "friction"),
        Known("offset_A", "A", 0.0, -5.0, 5.0, "of the sensor"),
    )
    response, angle, rate = "current_A", "angle_rad", "rate_rad_per_s"

    def columns(self, s):
        found = {"inertia_As2_per_rad": s["acceleration"], "viscous_As_per_rad": s["rate"]}
        return found | {"coulomb_A": s["direction"], "offset_A": np.ones_like(s["t"])}


class HeavyJoint(Joint):
    parameters = (
        *Joint.parameters,
        Known("cosine_A", "A", 0.0, -50.0, 50.0, "gravity"),
        Known("sine_A", "A", 0.0, -50.0, 50.0, "gravity"),
    )

    def columns(self, s):
        return super().columns(s) | {"cosine_A": np.cos(s["angle"]), "sine_A": np.sin(s["angle"])}
