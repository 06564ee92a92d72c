"""Estimates of a simulator's figures between the simulated points, with the error of each estimate.

One `Surface` is one figure over the candidates' changes z (each in its own step, 0 for the unchanged simulation): a
Gaussian process whose covariance is that of a polynomial of second degree with unknown coefficients, and of a smooth
remainder that is known only near the points (Rasmussen and Williams 2006, Gaussian Processes for Machine Learning,
chapters 2 and 5):

    k(z, z') = C^2 + L^2 z.z' + Q^2 ((z.z')^2 + sum z_j^2 z'_j^2) / 2 + R^2 exp(-|z - z'|^2 / 2)

Runs of one point differ by their seeds; the points' means carry that noise. L, Q and R are the values of a grid that
make the points most likely.
"""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# In standard deviations of the figure over the points: from an invisible effect to one above all of them.
SLOPES = (0.1, 0.3, 1.0, 3.0)
BENDS = (0.01, 0.03, 0.1, 0.3, 1.0)
REMAINDERS = (0.01, 0.03, 0.1, 0.3, 1.0)
CONSTANT = 10.0
# Runs of one point give a poor estimate of their own scatter: the scatter of all points weighs as this many more runs.
POOLED_RUNS = 4.0


class Surface:
    """places: (n, p); runs: for each place the figure in its runs, shape (k,) each, at least one of them."""

    def __init__(self, places: Array, runs: Sequence[Array]) -> None:
        self.places = places
        self.means = np.array([each.mean() for each in runs])
        squares = np.array([((each - each.mean()) ** 2).sum() for each in runs])
        counts = np.array([len(each) for each in runs], dtype=float)
        spare = max(float((counts - 1.0).sum()), 1.0)
        pooled = float(squares.sum()) / spare
        self.run_variance = (POOLED_RUNS * pooled + squares) / (POOLED_RUNS + counts - 1.0)
        self.centre = float(self.means.mean())
        spread = float(self.means.std())
        self.scale = spread if spread > 0.0 else max(abs(self.centre), 1.0) * 1e-9
        noise = self.run_variance / counts / self.scale**2 + 1e-10
        target = (self.means - self.centre) / self.scale
        parts = _parts(places, places)
        best = -np.inf
        for slope, bend, remainder in itertools.product(SLOPES, BENDS, REMAINDERS):
            scales = (CONSTANT, slope, bend, remainder)
            lower = np.linalg.cholesky(_sum(parts, scales) + np.diag(noise))
            half = np.linalg.solve(lower, target)
            likelihood = -0.5 * float(half @ half) - float(np.log(np.diag(lower)).sum())
            if likelihood > best:
                best, self.scales, self.lower = likelihood, scales, lower
        self.weights = np.linalg.solve(self.lower.T, np.linalg.solve(self.lower, target))

    def mean(self, asked: Array) -> Array:
        """Mean of the figure at `asked`, (m, p) -> (m,)."""
        return self.centre + self.scale * (_sum(_parts(asked, self.places), self.scales) @ self.weights)

    def slopes(self, asked: Array) -> Array:
        """Derivatives of the mean over each candidate: (m, p)."""
        _, slope, bend, remainder = self.scales
        near = np.exp(-0.5 * _distances(asked, self.places))
        turned = (asked @ self.places.T * self.weights) @ self.places + asked * (self.weights @ self.places**2)
        smooth = (near * self.weights) @ self.places - (near @ self.weights)[:, None] * asked
        whole = slope**2 * (self.weights @ self.places) + bend**2 * turned + remainder**2 * smooth
        return np.asarray(self.scale * whole)

    def __call__(self, asked: Array) -> tuple[Array, Array]:
        """Mean and variance of the figure at `asked`, (m, p) -> (m,), (m,); the variance excludes a run's own noise."""
        across = _sum(_parts(asked, self.places), self.scales)
        half = np.linalg.solve(self.lower, across.T)
        variance = _sum(_own(asked), self.scales) - (half**2).sum(axis=0)
        return self.centre + self.scale * (across @ self.weights), self.scale**2 * np.maximum(variance, 0.0)


def _parts(first: Array, second: Array) -> tuple[Array, Array, Array, Array]:
    dots = first @ second.T
    squares = (first**2) @ (second**2).T
    return np.ones_like(dots), dots, 0.5 * (dots**2 + squares), np.exp(-0.5 * _distances(first, second))


def _distances(first: Array, second: Array) -> Array:
    """Squared distances of each row of `first` to each of `second`."""
    squares = (first**2).sum(axis=1)[:, None] + (second**2).sum(axis=1) - 2.0 * (first @ second.T)
    return np.asarray(np.maximum(squares, 0.0))


def _own(asked: Array) -> tuple[Array, Array, Array, Array]:
    """`_parts` of each row with itself, (m,) each."""
    length = (asked**2).sum(axis=1)
    return np.ones_like(length), length, 0.5 * (length**2 + (asked**4).sum(axis=1)), np.ones_like(length)


def _sum(parts: Sequence[Array], scales: Sequence[float]) -> Array:
    return sum((scale**2 * part for scale, part in zip(scales, parts, strict=True)), np.zeros_like(parts[0]))
