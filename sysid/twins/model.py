"""Everything that a walk is compared with: maps, scatter and directions of one controller by one rate of the log.

A walk is one vector: the trimmed mean of what the map leaves, in its deviations, of the steps of either leg, shape (2
p,)."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.twins.step_map import LegMap, Rest
from ranger_sim.sysid.twins.steps import INNER, OUTER

TRIM = 0.1  # of the steps at either end, which do not count
FEWEST = 3  # steps of either leg


@dataclasses.dataclass(frozen=True)
class Knot:
    """Walks that were emulated for one log, with a cause of one size. moved: (2 p,) from a sound walk; steps: of them,
    0 when the robot falls at once with it."""

    size: float
    moved: Array
    steps: int


@dataclasses.dataclass(frozen=True)
class Direction:
    """How a cause moves the vector. terms: (3, 2 p) of its size, the square and the cube; unsure: (3, 3) covariance of
    these coefficients for a walk of one step; low, high: smallest and largest size that was made, which include 0;
    tolerance: deviation of the size among sound robots; knots: what was emulated for the log, by size."""

    cause: str
    at: str
    parameter: str
    form: str
    low: float
    high: float
    tolerance: float
    terms: Array
    unsure: Array
    knots: tuple[Knot, ...] = ()

    @property
    def name(self) -> str:
        """As an answer has it."""
        return f"{self.cause} at {self.at}"


@dataclasses.dataclass(frozen=True)
class View:
    """Of one rate of the log. few: of the hip's and the leg's angle and the walk's state alone.

    floors_m: (f,) roughness; footholds: (f,) what `step_map.roughness` gives there; middle: (f, 2 p); deviation:
    (f, 2 p) of one step; correlation: (2, p, p) of a leg's steps; between: (k, 2 p), in which walks differ as a whole;
    loose: (k, 2 p), in which bodies within tolerances differ beyond the sum of these; alarms: (a, 3) gain of the best
    cause, distance and floor's number, of sound walks that had no part in the scatter.
    """

    few: bool
    legs: tuple[LegMap, LegMap]
    floors_m: Array
    footholds: Array
    middle: Array
    deviation: Array
    correlation: Array
    between: Array
    loose: Array
    directions: tuple[Direction, ...]
    alarms: Array

    def floor(self, spread: float) -> tuple[float, Array]:
        """(roughness in m, weights of the floors (f,)) of a walk by the spread of its footholds."""
        if len(self.footholds) == 1 or not np.isfinite(spread):
            return float(self.floors_m[0]), np.eye(len(self.footholds))[0]
        place = float(np.interp(spread**2, self.footholds**2, np.arange(len(self.footholds))))
        low = min(int(place), len(self.footholds) - 2)
        weights = np.zeros(len(self.footholds))
        weights[low], weights[low + 1] = low + 1 - place, place - low
        return float(weights @ self.floors_m), weights

    def foothold(self, floor_m: float) -> float:
        """The spread of a sound walk's footholds on a floor of this roughness."""
        return float(np.sqrt(np.interp(floor_m**2, self.floors_m**2, self.footholds**2)))

    def roughness(self, spread_square: float) -> float:
        """The floor, in m, on which a sound walk's footholds have the square of a spread; 0 when it is not known."""
        if not np.isfinite(spread_square):
            return 0.0
        return float(np.sqrt(np.interp(spread_square, self.footholds**2, self.floors_m**2)))


@dataclasses.dataclass(frozen=True)
class Mean:
    """A walk or a part of it as one vector. value: (2 p,), not a number where a feature is missing; steps: of either
    leg."""

    value: Array
    steps: tuple[int, int]


def mean_of(found: Rest, rows: np.ndarray | None = None) -> Mean | None:
    """The trimmed mean of the steps that count; None when either leg has too few."""
    counted = found.inside if rows is None else found.inside & rows
    parts: list[Array] = []
    counts = []
    for side in (OUTER, INNER):
        left = found.left[counted & (found.leg == side)]
        if len(left) < FEWEST:
            return None
        parts.append(trimmed(left))
        counts.append(len(left))
    return Mean(np.concatenate(parts), (counts[0], counts[1]))


def trimmed(left: Array) -> Array:
    """The mean without the ends of each column, (n, p) to (p,)."""
    cut = int(TRIM * len(left))
    ordered = np.sort(left, axis=0)
    return np.asarray(ordered[cut : len(left) - cut].mean(0))


def scatter(view: View, weights: Array, steps: Sequence[int], without: str = "", nominal: bool = False) -> Array:
    """Covariance (2 p, 2 p) of the vector of a sound walk with so many steps of either leg. without: the name of a
    cause whose tolerance does not count; nominal: of robots without tolerances."""
    p = view.correlation.shape[1]
    deviation = np.sqrt(weights @ view.deviation**2)
    out = view.between.T @ view.between
    for side in (OUTER, INNER):
        rows = slice(side * p, (side + 1) * p)
        out[rows, rows] += view.correlation[side] * np.outer(deviation[rows], deviation[rows]) / steps[side]
    if nominal:
        return np.asarray(out)
    out += view.loose.T @ view.loose
    for each in view.directions:
        if each.tolerance and each.name != without:
            step = each.terms[0] * each.tolerance
            out += np.outer(step, step)
    return np.asarray(out)
