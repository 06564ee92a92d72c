"""Effects missing in the electric balance: brushes, warmth, bridge and supply."""

import numpy as np

from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Columns, Effect, Recording, Values
from ranger_sim.sysid.machines.forms import CURRENT_SHARES, HEAT_TIMES_S, Shape, column, one, over


def _heat(r: Recording, shape: Shape) -> Array:
    """What warms with the winding's losses: measured, or I^2 behind a first-order filter."""
    if shape["time_constant_s"] == 0.0:
        return r.signals["warmth"]
    return signals.lagged(r.table, r.signals["I"] ** 2, shape["time_constant_s"])


def electrical(top_I: float, top_V: float, warmth: bool) -> list[Effect]:
    heats = [{"time_constant_s": time_s} for time_s in ((0.0,) if warmth else ()) + HEAT_TIMES_S]
    E = "electrical"

    def torque_constant(r: Recording, shape: Shape, _: Values) -> Columns:
        heat = _heat(r, shape)
        return {"electric": column(r.signals["w"] * heat), "mechanical": column(r.signals["I"] * heat)}

    def two_heats(r: Recording, shape: Shape, _: Values) -> Columns:
        """The winding is as warm as its housing, and warmer by its own losses and by what was left from before."""
        current = r.signals["I_by_torque"]
        own = signals.lagged(r.table, r.signals["I"] ** 2, shape["winding_time_s"])
        left = np.exp(-r.signals["t"] / shape["winding_time_s"])
        return {"electric": column(current * r.signals["warmth"], current * own, current * left)}

    above_housing = [
        Effect(
            "resistance_temperature",
            "hip_motor",
            E,
            ("ohm_per_heat", "ohm_per_A2", "ohm_at_start"),
            [{"winding_time_s": time_s} for time_s in HEAT_TIMES_S if warmth],
            two_heats,
            lambda found: found["ohm_per_heat"] > 0.0 and found["ohm_per_A2"] > 0.0,
            "resistance that grows with the winding's temperature",
            form="winding and housing",
            free=("ohm_at_start",),
        )
    ]
    return [
        Effect(
            "contact_drop_change",
            "hip_motor",
            E,
            ("change_V",),
            [{"current_A": share * top_I} for share in CURRENT_SHARES],
            one("electric", lambda s, p, _: s["sgn_I"] * (1.0 - np.exp(-np.abs(s["I_by_torque"]) / p["current_A"]))),
            meaning="a drop at the brushes that depends on the current",
            scale="current_A",
        ),
        Effect(
            "resistance_temperature",
            "hip_motor",
            E,
            ("ohm_per_heat",),
            heats,
            lambda r, p, _: {"electric": column(r.signals["I_by_torque"] * _heat(r, p))},
            lambda found: found["ohm_per_heat"] > 0.0,
            "resistance that grows with the winding's temperature",
            form="one heat",
        ),
        *above_housing,
        Effect("torque_constant_temperature", "hip_motor", E, ("per_heat",), heats, torque_constant),
        Effect(
            "dead_time",
            "hip_motor",
            E,
            ("drop_V",),
            [{}],
            one("electric", lambda s, p, _: s["sgn_I"] * (np.abs(s["V_by_torque"]) > 0.02 * top_V)),
            meaning="a drop against the current while the bridge switches",
        ),
        Effect(
            "battery_sag",
            "supply",
            E,
            ("per_A",),
            [{}],
            one("electric", lambda s, p, _: s["V_by_torque"] * np.abs(s["I_by_torque"])),
        ),
        Effect(
            "charge_drift",
            "supply",
            E,
            ("per_As",),
            [{}],
            lambda r, p, _: {
                "electric": column(r.signals["V_by_torque"] * signals.integral(r.table, np.abs(r.signals["I"])))
            },
        ),
        Effect(
            "voltage_clip",
            "voltage_V",
            E,
            ("share",),
            [{"limit_V": share * top_V} for share in (0.5, 0.6, 0.7, 0.8, 0.9, 0.95)],
            one("electric", lambda s, p, _: over(s["V_by_torque"], p["limit_V"])),
            scale="limit_V",
        ),
        Effect(
            "pwm_ripple",
            "hip_motor",
            E,
            ("V_per_V",),
            [{}],
            one("electric", lambda s, p, _: s["V_by_torque"] * (1.0 - np.abs(s["V_by_torque"]) / top_V)),
        ),
    ]
