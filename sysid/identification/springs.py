"""Table 2's springs: k_h and k_s by the scale's pull (appendix 7.3, figure 25)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ranger_sim.sysid.benches.springs import ANKLE_ARM_M, HIP_ARM_M, ZEROED
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.fit import Fit, Parameter
from ranger_sim.sysid.identification.blocks import Block, column, corrected, length, same_rows, solve
from ranger_sim.sysid.instruments import FISH_SCALE, TAPE_M

Array = NDArray[np.float64]

K_H = Parameter("k_h", "N m/rad", 5.0, 1e-3, 1e4, "start: what holds a leg of some kg")
K_S = Parameter("k_s", "N m/rad", 10.0, 1e-3, 1e5, "start: stiffer than the hip's")
FRICTION = Parameter("hip-spring.friction_Nm", "N m", 0.05, -5.0, 50.0, "start: a gearbox")


def pull_block(bench: str, data: Dataset, spring: Parameter, arm_m: float, friction: bool) -> Block:
    """F l = k th, and with `friction` what rubs, added when pulled out and taken off when let back in."""
    angle, force, side = (column(data, name, bench) for name in ("angle_rad", "force_N", "side"))
    outward = column(data, "outward", bench, 1.0)
    same_rows(data, bench, angle, force, side, outward)
    turned, angle_errors = corrected(bench, angle, ZEROED)
    pulled, force_errors = corrected(bench, force, FISH_SCALE)
    way = np.where(outward > 0.0, 1.0, -1.0)
    rough = float(np.sum(force * arm_m * np.abs(angle)) / np.sum(angle**2))
    sigma = np.hypot(FISH_SCALE.sigma * arm_m, rough * ZEROED.sigma)
    arm = f"{bench}.arm_m"

    def residual(v: dict[str, float]) -> Array:
        rubs = v["hip-spring.friction_Nm"] * way if friction else 0.0
        return (pulled(v) * v[arm] - v[spring.name] * turned(v) * side - rubs) / sigma

    asked = (spring, FRICTION) if friction else (spring,)
    nuisances = (*angle_errors, *force_errors, length(arm, arm_m, TAPE_M, "by tape measure"))
    return Block(bench, asked, nuisances, residual, len(angle))


def hip_block(data: Dataset, arm_m: float = HIP_ARM_M) -> Block:
    """The hip's: its friction is asked too where there are pulls both ways."""
    both = len(set(column(data, "outward", "hip-spring", 1.0) > 0.0)) > 1
    return pull_block("hip-spring", data, K_H, arm_m, friction=both)


def ankle_block(data: Dataset, arm_m: float = ANKLE_ARM_M) -> Block:
    """The ankle cable's, with the return springs beside it (appendix 7.3)."""
    return pull_block("ankle-spring", data, K_S, arm_m, friction=False)


def hip(data: Dataset, arm_m: float = HIP_ARM_M, tell: Callable[[str], None] | None = None) -> Fit:
    """k_h, and the hip's friction."""
    return solve([hip_block(data, arm_m)], tell=tell)


def ankle(data: Dataset, arm_m: float = ANKLE_ARM_M, tell: Callable[[str], None] | None = None) -> Fit:
    """k_s."""
    return solve([ankle_block(data, arm_m)], tell=tell)
