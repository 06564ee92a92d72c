"""Friction of motor and gearbox in addition to Coulomb's and the viscous part."""

from collections.abc import Mapping

import numpy as np

from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Columns, Effect, Recording, Values
from ranger_sim.sysid.machines.forms import HEAT_TIMES_S, SPEED_SHARES, Made, Shape, bristles, column, one

DEFLECTIONS_RAD = (1e-4, 2e-4, 4e-4, 8e-4, 1.6e-3, 3.2e-3, 6.4e-3, 0.0128, 0.03, 0.1)


def friction(top_w: float) -> list[Effect]:
    M = "mechanical"
    speeds = [{"speed_rad_s": share * top_w} for share in SPEED_SHARES]

    def presliding(r: Recording, shape: Shape, v: Values) -> Columns:
        s = r.signals
        limit = v["constant_friction_Nm"] + v["load_friction_Nm_per_A"] * np.abs(s["I"])
        return {"mechanical": column(limit * (s["sgn_w"] - bristles(r, s["w"], shape["deflection_rad"])))}

    def warm_up(r: Recording, shape: Shape, _: Values) -> Columns:
        s = r.signals
        worked = signals.lagged(r.table, np.abs(s["w"]), shape["time_constant_s"])
        return {"mechanical": column(s["sgn_w"] * worked)}

    def direction(kind: str) -> Made:
        def made(s: Mapping[str, Array], _: Shape, __: Values) -> Array:
            return -np.ones_like(s["w"]) if kind == "coulomb" else -np.abs(s["w"])

        return one("mechanical", made)

    return [
        Effect(
            "stribeck",
            "hip_motor",
            M,
            ("excess_Nm",),
            speeds,
            one("mechanical", lambda s, p, _: -s["sgn_w"] * np.exp(-((s["w"] / p["speed_rad_s"]) ** 2))),
            lambda found: found["excess_Nm"] > 0.0,
            "friction that is larger at low speed",
            scale="speed_rad_s",
        ),
        Effect(
            "presliding",
            "hip_motor",
            M,
            ("share_of_friction",),
            [{"deflection_rad": way} for way in DEFLECTIONS_RAD],
            presliding,
            lambda found: 0.3 < found["share_of_friction"] < 3.0,
            "friction that builds up over a way after a reversal",
            scale="deflection_rad",
        ),
        Effect(
            "load_friction",
            "hip_motor",
            M,
            ("per_A",),
            [{}],
            one("mechanical", lambda s, p, _: -np.abs(s["I"]) * s["sgn_w"] * (s["I"] * s["w"] > 0.0)),
            meaning="friction under load that differs between driving and being driven",
        ),
        Effect("direction_friction", "hip_motor", M, ("coulomb_Nm",), [{}], direction("coulomb")),
        Effect("direction_friction", "hip_motor", M, ("viscous_Nms",), [{}], direction("viscous")),
        Effect(
            "friction_warm_up",
            "hip_motor",
            M,
            ("Nm_s_per_rad",),
            [{"time_constant_s": time_s} for time_s in HEAT_TIMES_S],
            warm_up,
            lambda found: found["Nm_s_per_rad"] > 0.0,
            "friction that falls as the gearbox warms",
        ),
        Effect(
            "drag",
            "hip_motor",
            M,
            ("quadratic_Nms2",),
            [{}],
            one("mechanical", lambda s, p, _: -s["w"] * np.abs(s["w"])),
            lambda found: found["quadratic_Nms2"] > 0.0,
        ),
    ]
