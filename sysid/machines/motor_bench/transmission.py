"""Effects between the rotor's angle and the output's speed."""

import numpy as np

from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Columns, Effect, Recording, Values
from ranger_sim.sysid.machines.forms import Shape, column, one

CALM = 2.0  # samples; Gaussian of the load: its noise would turn the flank to and fro
SHARES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # of the inertia, before the gap


def _torque(r: Recording, v: Values, share_of_inertia: float = 1.0) -> Array:
    """Torque behind the gearbox by the model, with so much of the rotor's inertia before it; the load cell's noise is
    not in it."""
    s = r.signals
    pulls = (v["torque_constant_Nm_per_A"] - v["load_friction_Nm_per_A"] * s["sgn_w"] * np.sign(s["I"])) * s["I"]
    rest = v["constant_friction_Nm"] * s["sgn_w"] + v["viscous_friction_Nms"] * s["w"]
    return np.asarray(pulls - rest - share_of_inertia * v["inertia_kg_m2"] * s["dw"])


def transmission() -> list[Effect]:
    T = "transmission"

    def play(r: Recording, shape: Shape, v: Values) -> Columns:
        """The output lies against the flank that carries the load, and crosses the gap in some milliseconds."""
        load = signals.smooth(r.table, _torque(r, v, shape["share_of_inertia"]), CALM)
        flank = signals.lagged(r.table, np.tanh(load / shape["torque_Nm"]), shape["crossing_s"])
        rate = np.gradient(flank, r.table.step_s)
        jerk = np.gradient(rate, r.table.step_s)
        return {
            "electric": column(v["torque_constant_Nm_per_A"] * rate),
            "mechanical": column(-v["viscous_friction_Nms"] * rate - v["inertia_kg_m2"] * jerk),
            T: column(rate),
        }

    plays = [
        {"share_of_inertia": share, "torque_Nm": load, "crossing_s": time_s}
        for share in SHARES
        for load in (0.02, 0.05)
        for time_s in (0.002, 0.004, 0.008)
    ]
    return [
        Effect("cable_stiffening", T, T, ("rad_per_Nm",), [{}], one(T, lambda s, p, _: s["dT"])),
        Effect("cable_backlash", T, T, ("half_gap_rad",), plays, play),
        Effect("pulley_slip", T, T, ("share",), [{}], one(T, lambda s, p, _: s["w_by_voltage"])),
    ]  # fmt: skip
