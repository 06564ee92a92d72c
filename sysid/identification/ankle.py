"""The foot from an ankle that tracks a sine: its inertia, the return spring, the friction.

The feedback law is inside the simulation and angles are compared: at the law's stiffness a few ms of latency of a
current would weigh more than the foot. What other benches know of the cable and the gearbox comes with its uncertainty.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR
from ranger_sim.sysid.benches.ankle_sine import ENCODER, DAMPING_As_per_rad, STIFFNESS_A_per_rad
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.fit import Fit, Parameter
from ranger_sim.sysid.identification.blocks import Block, column, solve

Array = NDArray[np.float64]

STEP_S = 0.001  # of the fourth-order steps; the fastest mode, the law's damping on the rotor, is 540 1/s
SETTLED_S = 0.3  # of each stretch that is not compared: what was assumed of its start is gone by then
SHORTEST_S = 1.0  # of a stretch without a gap

COLUMNS = ("motor_angle_rad", "joint_angle_rad", "joint_rate_rad_per_s", "target_angle_rad", "target_rate_rad_per_s")
J_FOOT = Parameter("J_foot", "kg m^2", 0.002, 1e-5, 1.0, "start: a hand's breadth of a few hundred grams")
K_R = Parameter("k_r", "N m/rad", 0.1, -5.0, 50.0, "start: soft")
BIAS = Parameter("return_Nm", "N m", 0.05, -20.0, 20.0, "start: little; of the return spring at angle 0")
C_0 = Parameter("ankle_C_0", "N m", 0.05, -1.0, 10.0, "start: a gearbox")
# of the other benches: table 3, and the pull of the ankle (its standard error by ankle-spring)
MU = Parameter("ankle.mu", "1", 0.1, -0.5, 1.0, "table 3", uncertainty=0.01)
K_S = Parameter("ankle.k_s", "N m/rad", 14.0, 1.0, 1e3, "table 2", uncertainty=0.2)


def simulated(
    v: dict[str, float], times: Array, target: Array, target_rate: Array, start: tuple[float, float, float]
) -> tuple[Array, Array]:
    """Motor and joint angle at `times`, from (motor angle, joint angle, rate of both), with targets given there."""
    m = ANKLE_MOTOR
    GK, J_A, smoothing = m.gear * m.torque_constant_Nm_per_A, m.reflected_inertia_kg_m2, m.friction_smoothing_rad_s
    mu, C_0, C_1, k_s = v["ankle.mu"], v["ankle_C_0"], m.viscous_friction_Nms, v["ankle.k_s"]
    J_f, k_r, bias = v["J_foot"], v["k_r"], v["return_Nm"]
    h = STEP_S
    half = np.arange(0.0, float(times[-1] - times[0]) + 2.0 * h, 0.5 * h)
    goals = np.interp(half, times - times[0], target).tolist()
    rates = np.interp(half, times - times[0], target_rate).tolist()
    p, a, u = start
    w = u
    tanh = math.tanh

    def slope(k: int, p: float, a: float, u: float) -> tuple[float, float]:
        drive = GK * (STIFFNESS_A_per_rad * (goals[k] - p) + DAMPING_As_per_rad * (rates[k] - u))
        cable = k_s * (p - a)
        rubs = (mu * abs(drive) + C_0) * tanh(u / smoothing) + C_1 * u
        return (drive - rubs - cable) / J_A, (cable - k_r * a + bias) / J_f

    found_p, found_a = [p], [a]
    for k in range(0, len(half) - 2, 2):
        u1, w1 = slope(k, p, a, u)
        u2, w2 = slope(k + 1, p + 0.5 * h * u, a + 0.5 * h * w, u + 0.5 * h * u1)
        u3, w3 = slope(
            k + 1, p + 0.5 * h * u + 0.25 * h * h * u1, a + 0.5 * h * w + 0.25 * h * h * w1, u + 0.5 * h * u2
        )
        u4, w4 = slope(k + 2, p + h * u + 0.5 * h * h * u2, a + h * w + 0.5 * h * h * w2, u + h * u3)
        p += h * u + h * h / 6.0 * (u1 + u2 + u3)
        a += h * w + h * h / 6.0 * (w1 + w2 + w3)
        u += h / 6.0 * (u1 + 2.0 * u2 + 2.0 * u3 + u4)
        w += h / 6.0 * (w1 + 2.0 * w2 + 2.0 * w3 + w4)
        found_p.append(p)
        found_a.append(a)
    grid = h * np.arange(len(found_p))
    return np.interp(times - times[0], grid, found_p), np.interp(times - times[0], grid, found_a)


def sine_blocks(data: Dataset) -> list[Block]:
    """One for each stretch without a gap."""
    for name in COLUMNS:
        column(data, name, "ankle-sine")
    table = data.table(COLUMNS)
    blocks = []
    for run in table.runs:
        t = table.time_s[run]
        if len(t) < 50 or t[-1] - t[0] < SHORTEST_S:
            continue
        blocks.append(_stretch(f"ankle-sine, {t[0]:.1f} s", t, *(table[name][run] for name in COLUMNS)))
    if not blocks:
        raise UserError(f"{data.name}: ankle-sine needs a stretch of {SHORTEST_S:g} s without a gap")
    return blocks


def _stretch(name: str, t: Array, motor: Array, joint: Array, rate: Array, goal: Array, goal_rate: Array) -> Block:
    """Both angles of one stretch against the simulated ones."""
    compared = t - t[0] >= SETTLED_S
    start = float(motor[0]), float(joint[0]), float(rate[0])

    def residual(v: dict[str, float]) -> Array:
        p, a = simulated(v, t, goal, goal_rate, start)
        return np.concatenate([(motor - p)[compared], (joint - a)[compared]]) / ENCODER.sigma

    asked = (J_FOOT, K_R, BIAS, C_0)
    return Block(name, asked, (MU, K_S), residual, 2 * int(np.count_nonzero(compared)), series=True)


def foot(data: Dataset, tell: Callable[[str], None] | None = None) -> Fit:
    """Inertia of the foot, return spring and friction."""
    return solve(sine_blocks(data), tell=tell)
