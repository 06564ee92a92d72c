"""Test for a misfit of a model without a cause in mind: chi-square tests over general features.

The features of an equation are possible dependencies: cells of each signal and of each pair of signals, the
course of time, and slopes a few samples back. Each group is one test; Holm's rule keeps the chance that any of them
fires without a cause at the requested level.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy import ndimage, stats

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Columns, Machine, Recording
from ranger_sim.sysid.regression import Regression, explained

SINGLE_CELLS = 10
PAIR_CELLS = 5
TIME_CELLS = 8
BESIDE = 201  # lines of the spectrum whose median is the local level
FASTEST = 0.2  # of the spectrum: above it the counts of an encoder at a steady speed are lines themselves


@dataclasses.dataclass(frozen=True)
class Test:
    """One group of features in one equation: its chi-square, its degrees of freedom, probability by chance.

    share: of the residual's square that it explains, where it is known; of a line, among its neighbours.
    """

    equation: str
    features: str
    chi2: float
    freedom: int
    p: float
    share: float = 0.0


@dataclasses.dataclass
class Misfit:
    """Results of the tests. p: of the most significant test after Holm's rule; excess: chi-square over expectation."""

    tests: list[Test]
    p: float
    excess: float

    @property
    def telling(self) -> Test:
        """The most significant test."""
        return min(self.tests, key=lambda test: (test.p, -test.share, -test.chi2))


def edges(signal: Array, count: int) -> Array:
    """(count - 1,) or fewer inner borders of cells with equally many samples."""
    return np.unique(np.quantile(signal, np.linspace(0.0, 1.0, count + 1)[1:-1]))


def cells(signal: Array, count: int) -> np.ndarray:
    """(n,) number of the cell, 0 ... count-1; cells have equally many samples; equal values share a cell."""
    return np.searchsorted(edges(signal, count), signal, side="right")


def indicator(number: np.ndarray) -> Array:
    """(n, k): 1 in the column of each row's number, 0 elsewhere."""
    kept, place = np.unique(number, return_inverse=True)
    out = np.zeros((len(number), len(kept)))
    out[np.arange(len(number)), place] = 1.0
    return out


def tables(signals: Mapping[str, Array]) -> dict[str, Array]:
    """(n, k) cells of each signal alone."""
    return {
        f"over {name}": indicator(cells(signal, TIME_CELLS if name == "t" else SINGLE_CELLS))
        for name, signal in signals.items()
    }


def features(signals: Mapping[str, Array], lags: Sequence[int]) -> dict[str, Array]:
    """Groups of features (n, k) over an equation's general signals; lags: samples back at which slopes are used."""
    names = list(signals)
    groups = tables(signals)
    for first, one in enumerate(names):
        for other in names[first + 1 :]:
            a, b = cells(signals[one], PAIR_CELLS), cells(signals[other], PAIR_CELLS)
            groups[f"over {one} and {other}"] = indicator(a * PAIR_CELLS + b)
    for name in names:
        if name == "t":
            continue
        slope = np.gradient(signals[name])
        back = np.column_stack([np.roll(slope, lag) for lag in lags])
        groups[f"history of {name}"] = back
    return groups


General = list[tuple[str, str, list[Columns]]]  # (equation, group, one {equation: (n, k)} per recording)


def general_features(machine: Machine, recordings: Sequence[Recording]) -> General:
    """All groups of features of all equations."""
    places = dict.fromkeys(name for recording in recordings for name in recording.equations)
    return _groups(machine, recordings, list(places), lambda signals: features(signals, recordings[0].lags))


def over_one_signal(machine: Machine, recordings: Sequence[Recording]) -> General:
    """Tables over each signal alone, of all equations, and of entries by what passes through them."""
    places = dict.fromkeys(name for recording in recordings for name in (*recording.equations, *recording.entries))
    return _groups(machine, recordings, list(places), tables)


def _groups(
    machine: Machine,
    recordings: Sequence[Recording],
    places: Sequence[str],
    made: Callable[[Mapping[str, Array]], dict[str, Array]],
) -> General:
    """Groups of features of these equations and entries; cells are the same in all recordings."""
    found: General = []
    looked_over = [machine.generic(recording) for recording in recordings]
    for place in places:
        signals = [
            each.get(place, {}) if place in recording.equations or place in recording.entries else {}
            for recording, each in zip(recordings, looked_over, strict=True)
        ]
        together = {
            name: np.concatenate([each[name] for each in signals if name in each])
            for name in dict.fromkeys(name for each in signals for name in each)
        }
        if not together:
            continue
        ends = np.cumsum(
            [0, *(len(recording.table) if each else 0 for recording, each in zip(recordings, signals, strict=True))]
        )
        for group, matrix in made(together).items():
            columns = [
                _seen(recording, place, matrix[start:stop]) if stop > start else {}
                for recording, start, stop in zip(recordings, ends[:-1], ends[1:], strict=True)
            ]
            found.append((place, group, columns))
    return found


def _seen(recording: Recording, place: str, columns: Array) -> Columns:
    """Columns (n, k) at an equation, or what the equations show of them at an entry."""
    return recording.entries[place].respond(columns) if place in recording.entries else {place: columns}


def look(regression: Regression, general: General) -> Misfit:
    """Test the residual of a regression on general features, and on lines in its spectrum."""
    places: dict[tuple[str, ...], list[tuple[str, str, dict[str, Array]]]] = {}
    for place, group, columns in general:
        white = regression.whitened(columns)
        if white:
            places.setdefault(tuple(white), []).append((place, group, white))
    tests: list[Test] = []
    if all(recording.whitened for recording in regression.recordings):
        sounds = {name for r in regression.recordings for name, equation in r.equations.items() if equation.lines}
        tests += [line(equation, regression) for equation in regression.equations if equation in sounds]
    excess = 0.0
    for groups in places.values():
        gram, product = _beside([white for *_, white in groups], regression)
        start = 0
        for place, group, white in groups:
            part = slice(start, start + next(iter(white.values())).shape[1])
            start = part.stop
            chi2, freedom = explained(gram[part, part], product[part])
            if freedom:
                tests.append(Test(place, group, chi2, freedom, float(stats.chi2.sf(chi2, freedom))))
        gained, freedom = explained(gram, product)
        excess += gained - freedom
    if not tests:
        return Misfit([], 1.0, 0.0)
    p = min(1.0, min(test.p for test in tests) * len(tests))
    return Misfit(tests, p, max(0.0, excess))


def _beside(groups: Sequence[Mapping[str, Array]], regression: Regression) -> tuple[Array, Array]:
    """(m, m) products of all columns of these groups, projected off the base, and (m,) of them with the residual."""
    together = {name: np.hstack([white[name] for white in groups]) for name in groups[0]}
    shadow = regression.shadow(together)
    return regression.gram(together, shadow), regression.product(together, shadow, regression.residual)


def line(equation: str, regression: Regression) -> Test:
    """The strongest line in the spectrum of one equation's residual, relative to its neighbours on both sides."""
    good = regression.good[equation]
    even = np.zeros(len(good))
    even[good] = regression.residual[regression.rows[equation]]
    power = np.abs(np.fft.rfft(even))[1:-1] ** 2
    if np.count_nonzero(good) < 100 or len(power) < 10 * BESIDE:
        return Test(equation, "a line in time", 0.0, 2, 1.0)
    level = ndimage.median_filter(power, BESIDE, mode="nearest") / np.log(2.0)
    ratio = power / np.maximum(level, 1e-300)
    low, high = BESIDE, max(BESIDE + 1, int(FASTEST * len(power)))
    place = low + int(np.argmax(ratio[low:high]))
    chi2 = 2.0 * float(ratio[place])
    p = -math.expm1((high - low) * math.log1p(-math.exp(-min(0.5 * chi2, 700.0))))
    share = float(power[place] / np.sum(power[place - BESIDE // 2 : place + BESIDE // 2 + 1]))
    return Test(equation, f"a line at {place + 1} periods of the data", chi2, 2, max(p, 0.0), share)
