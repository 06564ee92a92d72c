"""The spring that the hip's motor compensates, from a walk's angles by the equation of the swing leg: no emulated walk.

With a leg's lean p positive forward, its centre of mass c below the hip and w ahead of the leg, about the hip:

    I p'' - m (c cos p + w sin p) x'' + m (c sin p - w cos p) (y'' + g) = -+ (T + T_friction - k h)

x, y: of the hip, which the standing leg carries about its ankle; h: hip angle; T: motor, positive with the inner legs
ahead; minus for inner legs that swing. While a foot pushes, until the other feet land, the tracker wants kp (+-hold -
h) - kd h' (robot.md C6.3 C). The motor's further torque is proportional to h, by the stiffness of the spring that it
compensates. That is one number, from all pushes; separate gains would be too many, because a push covers little of the
hip's range. The interval comes from leaving out one push at a time.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping

import numpy as np
from scipy.signal import savgol_filter
from scipy.stats import t as t_distribution

from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.sysid.dataset import Array
from studies.compare_walk.gait import INNER_PUSH, OUTER_PUSH, Walk

STEP_S = 0.005  # of the even grid; the log's own step is 6 ms
WINDOW = 13  # points of the local cubic: 65 ms, a fifth of the hip's half swing (chosen by us)
AFTER_S, BEFORE_S = 0.04, 0.03  # of a push left out: the motor's rise, and the window that would reach the strike
LONGEST_GAP_S = 0.015
FEWEST_PUSHES = 4


@dataclasses.dataclass(frozen=True)
class HipLaw:
    """Stiffness that the motor compensates, with its 95 % interval; unexplained torque, rms; number of pushes used."""

    made_up_for_Nm_per_rad: float
    ci95: tuple[float, float]
    left_Nm: float
    pushes: int


def of_walk(walk: Walk, body: BodyParameters, parameters: Mapping[str, float]) -> HipLaw | None:
    """The law over all pushes of a walk whose controller has these parameters; None with fewer than four good ones."""
    kp, kd, hold = parameters["CTRL_HIP_KP"], parameters["CTRL_HIP_KD"], parameters["HD_H_HOLD"]
    grid = np.arange(max(walk.hip[0][0], walk.lean[0][0]), min(walk.hip[0][-1], walk.lean[0][-1]), STEP_S)
    if len(grid) <= WINDOW:
        return None
    hip, hip_rate, hip_acceleration = derivatives(np.interp(grid, *walk.hip))
    outer, outer_rate, outer_acceleration = derivatives(np.interp(grid, *walk.lean))
    inner, inner_rate, inner_acceleration = outer - hip, outer_rate - hip_rate, outer_acceleration - hip_acceleration
    outer_stands = (outer, outer_rate, outer_acceleration)
    inner_stands = (inner, inner_rate, inner_acceleration)
    blocks = []
    for begin, end, state in pushes(walk):
        side = 1.0 if state == OUTER_PUSH else -1.0
        rows = np.flatnonzero((grid >= begin + AFTER_S) & (grid <= end - BEFORE_S))
        if len(rows) < WINDOW or has_gap(walk, begin, end):
            continue
        standing, swinging = (outer_stands, inner_stands) if side > 0.0 else (inner_stands, outer_stands)
        motor = -side * swing_moment(body, side > 0.0, standing, swinging) + body.hip_spring_Nm_per_rad * hip
        wanted = kp * (side * hold - hip) - kd * hip_rate
        blocks.append((hip[rows], (motor - wanted)[rows]))
    if len(blocks) < FEWEST_PUSHES:
        return None
    value = slope(blocks)
    count = len(blocks)
    without = np.array([slope(blocks[:i] + blocks[i + 1 :]) for i in range(count)])
    spread = math.sqrt((count - 1) / count * float(np.sum((without - without.mean()) ** 2)))
    reach = float(t_distribution.ppf(0.975, count - 1)) * spread
    left = np.concatenate([response - value * angle for angle, response in blocks])
    return HipLaw(value, (value - reach, value + reach), float(np.sqrt(np.mean(left**2))), count)


def derivatives(values: Array) -> tuple[Array, Array, Array]:
    """Smoothed value, rate and acceleration on the grid."""
    found = [savgol_filter(values, WINDOW, 3, deriv=order, delta=STEP_S) for order in (0, 1, 2)]
    return found[0], found[1], found[2]


def pushes(walk: Walk) -> list[tuple[float, float, int]]:
    """(begin, end, state) of every push that ended."""
    times, states = walk.state
    changes = np.flatnonzero(np.diff(states)) + 1
    return [
        (float(times[a]), float(times[b]), int(states[a]))
        for a, b in zip(changes[:-1], changes[1:], strict=True)
        if states[a] in (OUTER_PUSH, INNER_PUSH)
    ]


def has_gap(walk: Walk, begin: float, end: float) -> bool:
    """Whether stamps of the angles are missing, or values masked, in the push or in the window about it."""
    reach = 0.5 * WINDOW * STEP_S
    if walk.is_masked(begin - reach, end + reach):
        return True
    for time_s, _ in (walk.hip, walk.lean):
        inside = time_s[(time_s > begin - reach) & (time_s < end + reach)]
        if len(inside) < 2 or np.diff(inside).max() > LONGEST_GAP_S:
            return True
    return False


def swing_moment(
    body: BodyParameters, inner_swings: bool, standing: tuple[Array, Array, Array], swinging: tuple[Array, Array, Array]
) -> Array:
    """Left side of the swing leg's equation, N m."""
    p, _, acceleration = swinging
    q, q_rate, q_acceleration = standing
    inertia = body.inner_hip_inertia_kg_m2 if inner_swings else body.outer_hip_inertia_kg_m2
    below = body.inner_mass_moment_kg_m if inner_swings else body.outer_mass_moment_kg_m
    ahead = body.inner_mass_offset_kg_m if inner_swings else body.outer_mass_offset_kg_m
    x = body.leg_length_m * (np.cos(q) * q_acceleration - np.sin(q) * q_rate**2)
    y = body.leg_length_m * (-np.sin(q) * q_acceleration - np.cos(q) * q_rate**2)
    moment: Array = (
        inertia * acceleration
        - (below * np.cos(p) + ahead * np.sin(p)) * x
        + (below * np.sin(p) - ahead * np.cos(p)) * (y + body.gravity_m_per_s2)
    )
    return moment


def slope(blocks: list[tuple[Array, Array]]) -> float:
    """Slope of the line through zero, over all rows."""
    angle = np.concatenate([each for each, _ in blocks])
    response = np.concatenate([each for _, each in blocks])
    return float(angle @ response / (angle @ angle))
