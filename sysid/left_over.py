"""What named causes leave: tables over one signal each and over time, in the noise that all candidates leave.

A cause that is not in the catalogue is often like one that is: iron that saturates is like a scale of the current, a
load cell that creeps like friction under load. What such a name leaves goes with a signal, or with time. A table
over one signal has few numbers and sees that where a predictor of many features does not; chance is what all tables
together reach on surrogates. Tables over two signals and slopes of the past are not asked: what they
see on real recordings is mostly how samples were taken.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy import stats

from ranger_sim.sysid import likelihood, misfit
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Machine, Recording
from ranger_sim.sysid.regression import Regression

SEEN = 1e-4  # of a column's square: less of it off the base is rounding, and the noise of a measured column
RANK = 1e-4  # of the largest direction of a table


@dataclasses.dataclass(frozen=True)
class LeftOver:
    """The features that explain most beyond chance. chi2: less what chance explains; p: of all features together."""

    equation: str
    features: str
    chi2: float
    p: float


def look(machine: Machine, regression: Regression, recordings: Sequence[Recording], seed: int) -> LeftOver | None:
    """The largest part of a regression's residual that goes with one signal; None where no table can be made."""
    return _most(regression, misfit.over_one_signal(machine, recordings), seed)


def look_at_all(
    machine: Machine, regression: Regression, recordings: Sequence[Recording], seed: int
) -> LeftOver | None:
    """The same with pairs of signals and slopes of the past: for rows at which no sampling of a corner shows."""
    return _most(regression, misfit.general_features(machine, recordings), seed)


def _most(regression: Regression, general: misfit.General, seed: int) -> LeftOver | None:
    """Of all groups of features the one that explains most, among those that explain more than any by chance."""
    drawn = likelihood.surrogates(regression, seed)
    by_chance, found = [], []
    for equation, group, columns in general:
        white = regression.whitened(columns)
        turn, inflation = _directions(regression, white)
        if not len(turn):
            continue
        both = np.column_stack([regression.residual, drawn])
        explained = np.sum((turn @ regression.product(white, regression.shadow(white), both)) ** 2, axis=0) / inflation
        chance = explained[1:]
        # the noise is not quite that of the whitening: a chi-square with the chance's own mean and variance
        mean, variance = float(np.mean(chance)), float(np.var(chance))
        scores = stats.chi2.logsf(explained * (2.0 * mean / variance), 2.0 * mean**2 / variance)
        by_chance.append(scores[1:])
        found.append((float(scores[0]), float(explained[0]) - mean, equation, group))
    if not found:
        return None
    least = np.min(by_chance, axis=0)
    beyond = [each for each in found if each[0] < np.min(least)] or [min(found)]
    _, chi2, equation, group = max(beyond, key=lambda each: each[1])
    best = min(found)[0]
    # beyond all surrogates the chance of the least falls as that of each group does
    p = (1.0 + float(np.count_nonzero(least <= best))) / (1.0 + len(least))
    return LeftOver(equation, group, chi2, p * float(np.exp(min(0.0, best - np.min(least)))))


def _directions(regression: Regression, white: dict[str, Array]) -> tuple[Array, float]:
    """((m, k) turn of a table's products to directions of length 1 off the base, factor of its chi-square)."""
    shadow = regression.shadow(white)
    gram = regression.gram(white, shadow)
    whole = sum((np.sum(columns**2, axis=0) for columns in white.values()), np.zeros(len(gram)))
    off = np.diag(gram)
    scale = np.where(off > SEEN * np.maximum(whole, 1.0), 1.0 / np.sqrt(np.maximum(off, 1e-300)), 0.0)
    sizes, vectors = np.linalg.eigh(gram * np.outer(scale, scale))
    strong = sizes > RANK * max(float(sizes[-1]), 1e-300)
    if not np.any(scale):
        return np.zeros((0, len(gram))), 1.0
    return (vectors[:, strong] / np.sqrt(sizes[strong])).T * scale, regression.inflation(white, shadow, gram)
