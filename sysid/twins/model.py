"""Everything that a walk is compared with: maps, scatter and directions of one controller by one rate of the log.

A walk is one vector: the trimmed mean of what the map leaves, in its deviations, of the steps of either leg, shape (2
p,)."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy import special

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.twins.step_map import LegMap, Rest
from ranger_sim.sysid.twins.steps import INNER, OUTER

TRIM = 0.1  # of the steps at either end, which do not count
FEWEST = 3  # steps of either leg
RARE = 6.0  # deviations at which a sound step is cut
TRIED = 40  # floors, above level up to the roughest that was made
BEYOND = 3.0  # times the roughest floor that was made: as rough a floor a recording may look
SHOWN = 1.7  # times its variance on a level floor: a feature that has as much on the roughest one shows the floor


@dataclasses.dataclass(frozen=True)
class Knot:
    """Walks with a cause of one size. moved: (2 p,) from a sound walk; steps: of them, 0 when the robot falls at once
    with it."""

    size: float
    moved: Array
    steps: int


@dataclasses.dataclass(frozen=True)
class Direction:
    """How a cause moves the vector. terms: (3, 2 p) of its size, the square and the cube; unsure: (3, 3) covariance of
    these coefficients for a walk of one step; low, high: smallest and largest size that was made, which include 0;
    tolerance: deviation of the size among sound robots; knots: what was emulated for the log, by size; sound: the
    farthest size that a sound robot reaches by itself now and then, 0 for none; far: twins far beyond low and high."""

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
    sound: float = 0.0
    far: tuple[Knot, ...] = ()

    @property
    def name(self) -> str:
        """As an answer has it."""
        return f"{self.cause} at {self.at}"


@dataclasses.dataclass(frozen=True)
class View:
    """Of one rate of the log. few: of the hip's and the leg's angle and the walk's state alone.

    floors_m: (f,) roughness, rising; middle: (f, 2 p); deviation: (f, 2 p) of one step; correlation: (2, p, p) of a
    leg's steps; between: (k, 2 p), in which walks differ as a whole; loose: (k, 2 p), in which bodies within tolerances
    differ beyond the sum of these; alarms: (a, 3) gain of the best cause, distance and floor's number, of sound walks
    that had no part in the scatter.
    """

    few: bool
    legs: tuple[LegMap, LegMap]
    floors_m: Array
    middle: Array
    deviation: Array
    correlation: Array
    between: Array
    loose: Array
    directions: tuple[Direction, ...]
    alarms: Array

    def weights(self, floor_m: float) -> Array:
        """(f,) shares of the floors that were made in one of this roughness: variances go with its square."""
        count = len(self.floors_m)
        place = float(np.interp(floor_m**2, self.floors_m**2, np.arange(count)))
        low = max(min(int(place), count - 2), 0)
        weights = np.zeros(count)
        weights[low] = low + 1 - place
        if count > 1:
            weights[low + 1] = place - low
        return weights

    def roughness(self, found: Rest) -> float:
        """The roughness of the floor, in m, on which a sound robot's steps scatter as much as these; of floors up to
        the roughest that was made."""
        return min(self.looks(found), float(self.floors_m[-1]))

    def looks(self, found: Rest) -> float:
        """The same beyond the roughest floor that was made, where variances go on with the square of the roughness.

        A cause moves features; the floor scatters them. So each feature that shows the floor counts about its mean of
        either leg, and the median of all decides: no single one, which a slow log may sample too coarsely.
        """
        tried = self.floors_m[-1] * np.arange(int(TRIED * BEYOND) + 1) / TRIED
        rougher = np.maximum((tried / max(self.floors_m[-1], 1e-9)) ** 2 - 1.0, 0.0)[:, None]
        p = self.correlation.shape[1]
        beyond = []  # (floors, features): logarithms of variances, over what sound steps have on each floor
        for side in (OUTER, INNER):
            left = found.left[found.inside & (found.leg == side)]
            if len(left) < FEWEST:
                continue
            left = np.clip(left - np.median(left, 0), -RARE, RARE)
            variance = left.var(0, ddof=1)
            made = self.deviation[:, side * p : (side + 1) * p] ** 2
            sound = np.array([self.weights(each) @ made for each in tried]) + rougher * (made[-1] - made[0])
            shown = (made[-1] > SHOWN * made[0]) & np.isfinite(variance) & (variance > 0.0)
            half = 0.5 * (len(left) - 1)
            few = float(special.digamma(half)) - np.log(half)  # what the logarithm of a variance is too small by
            beyond.append(np.log(variance[shown]) - few - np.log(sound[:, shown]))
        together = np.hstack(beyond) if beyond else np.zeros((len(tried), 0))
        if not together.shape[1]:
            return 0.0
        return float(np.interp(0.0, -np.median(together, axis=1), tried))


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
