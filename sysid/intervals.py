"""Intervals of a named effect by its profile: every shape that explains the data nearly as well widens them.

A coefficient at the best shape of a grid is known better than the coefficient: another shape would have another. So the
95 % interval is all values that some shape takes with a chi-square at most 3.84 below the best (profile likelihood).
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ranger_sim.sysid.machine import Effect
from ranger_sim.sysid.naming import Named, by_shapes, inexact, possible, trials
from ranger_sim.sysid.regression import Regression

CHI2 = 3.84  # 95 % of one degree of freedom
Z95 = 1.96  # standard errors on each side of a 95 % interval
ROUNDS = 4  # of finer steps, each a seventh of the one before: an eighth of 6000 rows comes down to a row
WORTH = 1.0  # chi-square: a round of finer steps that gains less was the last one
BETWEEN = 6  # shapes between two neighbours of the grid, where a shape is on a scale

Intervals = dict[str, tuple[float, float]]


def profile(each: Named, base: Regression) -> tuple[Mapping[str, float], Intervals]:
    """(best shape, interval of every coefficient and shape by name). base: the regression with all but this effect."""
    found = _alike(_profiled(each.effect, _shapes(each), base))
    if not found:
        return each.shape, {}
    best = max(found, key=lambda one: one[0])
    # until the best shape's neighbours are nearly as likely; all times between two rows are alike
    for _ in range(0 if each.effect.once else ROUNDS - 1):
        if _even(best, found, each.effect.scale):
            break
        near = [*_between(each.effect, best[1], [one[1] for one in found]), *_itself(each.effect, *best[1:3])]
        found = _alike([*found, *_profiled(each.effect, near, base)])
        best = max(found, key=lambda one: one[0])
    intervals: Intervals = {}
    for chi2, shape, numbers, deviations, _, _ in found:
        left = CHI2 - (best[0] - chi2)
        if left < 0.0:
            continue
        reach = math.sqrt(left)
        for name, value in numbers.items():
            _widen(intervals, name, value - reach * float(deviations[name]), value + reach * float(deviations[name]))
        for name, value in shape.items():
            _widen(intervals, name, value, value)
    return best[1], {name: _to_neighbours(name, ends, found) for name, ends in intervals.items()}


# Chi-square among `_alike`, shape, values, deviations, gain and inflation
Profiled = tuple[float, Mapping[str, float], dict[str, float], dict[str, float], float, float]


def _alike(found: Sequence[Profiled]) -> list[Profiled]:
    """The same with chi-squares that can be compared (`by_shapes`)."""
    if not found:
        return []
    chi2s = by_shapes([one[4] for one in found], [one[5] for one in found])
    return [(chi2, *one[1:]) for chi2, one in zip(chi2s, found, strict=True)]


def _profiled(
    effect: Effect, shapes: Sequence[Mapping[str, float]], base: Regression, within_noise: bool = False
) -> list[Profiled]:
    """What an effect explains at each of these shapes, where a machine can have the values, or values within the noise
    of them."""
    found = []
    for trial in trials([effect], base, shapes):
        inverse = np.linalg.pinv(trial.gram, rcond=1e-12)
        values = inverse @ trial.product
        gain = float(values @ trial.product) - inexact(trial)
        numbers = dict(zip(effect.coefficients, (float(value) for value in values), strict=True))
        if possible(trial) if within_noise else effect.admissible({**numbers, **trial.shape}):
            spread = np.sqrt(np.maximum(np.diag(inverse), 0.0) * trial.inflation)
            deviations = dict(zip(numbers, (float(each) for each in spread), strict=True))
            found.append((gain / trial.inflation, trial.shape, numbers, deviations, gain, trial.inflation))
    return found


def _itself(effect: Effect, shape: Mapping[str, float], numbers: Mapping[str, float]) -> list[Mapping[str, float]]:
    """The shape that an exact effect's coefficient comes out as."""
    if effect.equals is None or not numbers[effect.coefficients[0]] > min(
        each[effect.equals] for each in effect.shapes
    ):
        return []
    return [{**shape, effect.equals: numbers[effect.coefficients[0]]}]


def _even(best: Profiled, found: Sequence[Profiled], scale: str | None) -> bool:
    """True where the best shape's neighbours on both sides explain nearly as much: the interval ends among them."""
    if scale is None:
        return True
    ordered = sorted(found, key=lambda one: one[1][scale])
    place = next(number for number, one in enumerate(ordered) if one is best)
    return all(best[0] - one[0] < CHI2 for one in ordered[max(0, place - 1) : place + 2])


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
    size, shape = each.effect.coefficients[0], each.effect.equals
    if shape is not None and each.shape[shape] > min(one[shape] for one in each.effect.shapes):  # one number
        for one, other in ((size, shape), (shape, size)):
            _widen(found, one, *found[other])
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
    tried = sorted({one[1][name] for one in found})
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
    tried, before = list(effect.shapes), 0.0
    more: list[Mapping[str, float]] = []
    for _ in range(0 if effect.scale is None else ROUNDS):
        near = [shape, *_between(effect, shape, tried), *more]
        found = _alike(_profiled(effect, near, base, within_noise=True))
        tried += near
        if not found:
            break
        before = next((one[0] for one in found if one[1] is shape), before)
        chi2, shape, numbers = max(found, key=lambda one: one[0])[:3]
        if not effect.once and chi2 - before < WORTH:
            break
        more = _itself(effect, shape, numbers)
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
