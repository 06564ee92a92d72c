"""A leg at the clamped hip (appendix 7.2, figures 23, 24, eq. 29-31): held level, hanging, swinging.

The hip drive and its springs are off; the leg turns in its bearings. About the hip, with th forward of straight down:

    J th'' = -g (cm sin th - wm cos th) - b th' - T_b sgn th'

so it hangs at atan(wm / cm). Every recording has both legs, distinguished by the column `inner` (0: outer, 1: inner).

    level      force_N of a scale at the ankle, leg horizontal, at angle_rad from it
    hang       angle_rad by an inclinometer, after some releases from either side
    pendulum   angle_rad of the hip's encoder against time, let go at rest
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.sysid.benches.motor import readings
from ranger_sim.sysid.dataset import Channel, Dataset
from ranger_sim.sysid.instruments import FISH_SCALE, INCLINOMETER, JOINT_ENCODER, TAPE_M

Array = NDArray[np.float64]

GRAVITY = 9.81
# Of two ball bearings with seals, in the size of their catalogue's starting torque. Chosen by us.
BEARING_Nm = 0.004
BEARING_Nms = 0.01
BEARING_SMOOTHING = 0.01  # rad/s, of sgn: eq. 43 with the appendix's epsilon
LEVEL_READINGS = 8
LEVEL_SCATTER_rad = 0.005  # by how much a hand misses the level
HANG_READINGS = 12
SWING_S = 12.0  # seven periods
SWING_HZ = 50.0
SWING_FROM_rad = 0.12  # small, as eq. 29 asks: the amplitude lengthens the period by 1e-3


@dataclasses.dataclass(frozen=True)
class Leg:
    """Seven inertial numbers less the whole mass, of one leg: first moments and inertia about the hip."""

    cm_kg_m: float
    wm_kg_m: float
    J_hip_kg_m2: float

    @property
    def rest_rad(self) -> float:
        """Where it hangs."""
        return math.atan2(self.wm_kg_m, self.cm_kg_m)


def legs_of(body: BodyParameters) -> tuple[Leg, Leg]:
    """Outer and inner."""
    return (
        Leg(body.outer_mass_moment_kg_m, body.outer_mass_offset_kg_m, body.outer_hip_inertia_kg_m2),
        Leg(body.inner_mass_moment_kg_m, body.inner_mass_offset_kg_m, body.inner_hip_inertia_kg_m2),
    )


def level_force_N(cm: float, wm: float, angle_rad: Array, arm_m: float) -> Array:
    """What holds a leg at `angle_rad` below the level, by a vertical force `arm_m` from the hip along it."""
    # the vertical force's arm shrinks with cos as the weight's does
    return GRAVITY * (cm + wm * np.tan(angle_rad)) / arm_m


def level(body: BodyParameters | None = None, seed: int = 1) -> Dataset:
    """Each leg held level by the scale, some times."""
    body = body or BodyParameters()
    missed = LEVEL_SCATTER_rad * generator(seed, "level: hand").standard_normal((2, LEVEL_READINGS))
    arm = body.leg_length_m + TAPE_M * float(generator(seed, "level: tape").standard_normal())
    force = [level_force_N(leg.cm_kg_m, leg.wm_kg_m, missed[k], arm) for k, leg in enumerate(legs_of(body))]
    inner = np.repeat([0.0, 1.0], LEVEL_READINGS)
    return readings("level", seed, {"force_N": (np.concatenate(force), FISH_SCALE), "inner": (inner, None)})


def hang(body: BodyParameters | None = None, seed: int = 1) -> Dataset:
    """Each leg left to come to rest, from either side; the bearings stop it anywhere that they can hold."""
    body = body or BodyParameters()
    random = generator(seed, "hang: bearings")
    angles = [
        leg.rest_rad + random.uniform(-1.0, 1.0, HANG_READINGS) * BEARING_Nm / (GRAVITY * leg.cm_kg_m)
        for leg in legs_of(body)
    ]
    inner = np.repeat([0.0, 1.0], HANG_READINGS)
    return readings("hang", seed, {"angle_rad": (np.concatenate(angles), INCLINOMETER), "inner": (inner, None)})


def swing(leg: Leg, start_rad: float, times: Array, coulomb_Nm: float, viscous_Nms: float) -> Array:
    """Angle at `times`, let go at rest at the first of them; error below 1e-8 rad."""

    def slope(_: float, state: Array) -> list[float]:
        angle, rate = state
        torque = -GRAVITY * (leg.cm_kg_m * math.sin(angle) - leg.wm_kg_m * math.cos(angle))
        torque -= viscous_Nms * rate + coulomb_Nm * math.tanh(rate / BEARING_SMOOTHING)
        return [rate, torque / leg.J_hip_kg_m2]

    found = solve_ivp(slope, (times[0], times[-1]), [start_rad, 0.0], "DOP853", times, rtol=1e-9, atol=1e-10)
    return found.y[0]


def pendulum(body: BodyParameters | None = None, seed: int = 1) -> Dataset:
    """Each leg let go from SWING_FROM_rad ahead of where it hangs; the inner leg's stamps follow the outer's."""
    body = body or BodyParameters()
    times = np.arange(round(SWING_S * SWING_HZ)) / SWING_HZ
    angles = [swing(leg, leg.rest_rad + SWING_FROM_rad, times, BEARING_Nm, BEARING_Nms) for leg in legs_of(body)]
    shown = JOINT_ENCODER.read(np.concatenate(angles), seed, "pendulum")
    time_s = np.concatenate([times, times + 2.0 * SWING_S])
    inner = np.repeat([0.0, 1.0], len(times))
    source = f"{JOINT_ENCODER.name}: {JOINT_ENCODER.source}"
    return Dataset(
        "pendulum",
        {
            "angle_rad": Channel("angle_rad", "rad", time_s, shown, JOINT_ENCODER.resolution, source),
            "inner": Channel("inner", "1", time_s, inner, source="set"),
        },
    )
