"""Intervals of a named effect by its profile: every shape that explains the data nearly as well widens them.

A coefficient at the best shape of a grid is known better than the coefficient: another shape would have another. So the
95 % interval is all values that some shape takes with a chi-square at most 3.84 below the best (profile likelihood).
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ranger_sim.sysid.machine import Effect
from ranger_sim.sysid.naming import Named, possible, trials
from ranger_sim.sysid.regression import Regression

CHI2 = 3.84  # 95 % of one degree of freedom
Z95 = 1.96  # standard errors on each side of a 95 % interval
ROUNDS = 4  # of finer steps, each a seventh of the one before: an eighth of 6000 rows comes down to a row
BETWEEN = 6  # shapes between two neighbours of the grid, where a shape is on a scale

Intervals = dict[str, tuple[float, float]]


def profile(each: Named, base: Regression) -> tuple[Mapping[str, float], Intervals]:
    """(best shape, interval of every coefficient and shape by name). base: the regression with all but this effect."""
    found = []
    for trial in trials([each.effect], base, _shapes(each)):
        inverse = np.linalg.pinv(trial.gram, rcond=1e-12)
        values = inverse @ trial.product
        chi2 = float(values @ trial.product) / trial.inflation
        numbers = dict(zip(each.effect.coefficients, (float(value) for value in values), strict=True))
        if each.effect.admissible({**numbers, **trial.shape}):
            spread = np.sqrt(np.maximum(np.diag(inverse), 0.0) * trial.inflation)
            found.append((chi2, trial.shape, numbers, dict(zip(numbers, spread, strict=True))))
    if not found:
        return each.shape, {}
    best = max(found, key=lambda one: one[0])
    intervals: Intervals = {}
    for chi2, shape, numbers, deviations in found:
        left = CHI2 - (best[0] - chi2)
        if left < 0.0:
            continue
        reach = math.sqrt(left)
        for name, value in numbers.items():
            _widen(intervals, name, value - reach * float(deviations[name]), value + reach * float(deviations[name]))
        for name, value in shape.items():
            _widen(intervals, name, value, value)
    return best[1], {name: _to_neighbours(name, ends, found) for name, ends in intervals.items()}


def whole(each: Named, regression: Regression, profiled: Intervals) -> Intervals:
    """The 95 % interval of every coefficient and shape of a named effect: its profile, and no less than 1.96 standard
    errors in the regression with all named effects, where these depend on each other."""
    found = {name: (value, value) for name, value in each.shape.items()}
    for name, full in zip(each.effect.coefficients, each.coefficients, strict=True):
        number = regression.names.index(full)
        value = regression.values[full]
        reach = Z95 * math.sqrt(max(0.0, float(regression.covariance[number, number])))
        found[name] = (value - reach, value + reach)
    for name, ends in profiled.items():
        _widen(found, name, *ends)
    return found


def sign_is_known(each: Named, intervals: Intervals) -> bool:
    """False where the interval of every coefficient has 0 in it."""
    ends = [intervals[name] for name in each.effect.coefficients]
    return any(low > 0.0 or high < 0.0 for low, high in ends)


def _widen(intervals: Intervals, name: str, low: float, high: float) -> None:
    was = intervals.get(name, (low, high))
    intervals[name] = (min(was[0], low), max(was[1], high))


def _to_neighbours(name: str, ends: tuple[float, float], found: list) -> tuple[float, float]:
    """A shape is known no better than to the middle of the next that was tried."""
    if name not in found[0][1]:
        return ends
    tried = sorted({shape[name] for _, shape, _, _ in found})
    low, high = tried.index(ends[0]), tried.index(ends[1])
    return (
        0.5 * (tried[low] + tried[low - 1]) if low else ends[0],
        0.5 * (tried[high] + tried[high + 1]) if high + 1 < len(tried) else ends[1],
    )


def _shapes(each: Named) -> list[Mapping[str, float]]:
    """The grid, and between the best and its neighbours more of it where the shape is on a scale."""
    return [*each.effect.shapes, *between(each)]


def finest(effect: Effect, shape: Mapping[str, float], base: Regression) -> Mapping[str, float]:
    """The likeliest shape about this one of the grid; in finer and finer steps for what happens at one time, of which a
    row may be most. base: without the effect."""
    tried = list(effect.shapes)
    for _ in range(0 if effect.scale is None else ROUNDS if effect.once else 1):
        near = [shape, *_between(effect, shape, tried)]
        scored = [(float(each.product @ np.linalg.pinv(each.gram, rcond=1e-12) @ each.product) / each.inflation, each)
                  for each in trials([effect], base, near) if possible(each)]  # fmt: skip
        if scored:
            shape = max(scored, key=lambda one: one[0])[1].shape
        tried += near
    return shape


def between(each: Named) -> list[Mapping[str, float]]:
    """Shapes between the best and its neighbours; none where the shape is not on a scale."""
    return _between(each.effect, each.shape, each.effect.shapes)


def _between(
    effect: Effect, shape: Mapping[str, float], shapes: Sequence[Mapping[str, float]]
) -> list[Mapping[str, float]]:
    name = effect.scale
    if name is None:
        return []
    values = sorted({each[name] for each in shapes})
    place = int(np.argmin([abs(value - shape[name]) for value in values]))
    near = values[max(0, place - 1) : place + 2]
    more = [
        low * (high / low) ** (number / (BETWEEN + 1))
        for low, high in zip(near[:-1], near[1:], strict=True)
        if low > 0.0
        for number in range(1, BETWEEN + 1)
    ]
    return [{**shape, name: value} for value in more]
