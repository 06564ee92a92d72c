"""Whether a model misses something in the data, without asking what: chi-square tests over general features.

The features of an equation are what could depend on what: cells of each signal and of each pair of signals, the
course of time, and what lies a few samples back. Each group is one test; Holm's rule keeps the chance that any of them
fires without a cause at the level asked for.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import stats

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Columns, Machine, Recording
from ranger_sim.sysid.regression import Regression, explained, orthonormal

SINGLE_CELLS = 10
PAIR_CELLS = 5
TIME_CELLS = 8


@dataclasses.dataclass(frozen=True)
class Test:
    """One group of features in one equation: chi-square it explains, its degrees of freedom, probability by chance."""

    equation: str
    features: str
    chi2: float
    freedom: int
    p: float


@dataclasses.dataclass
class Misfit:
    """What the tests say. p: of the most telling test after Holm's rule; excess: chi-square over its expectation."""

    tests: list[Test]
    p: float
    excess: float
    basis: Array  # (N, m) orthonormal: all features together

    @property
    def telling(self) -> Test:
        """The most telling test."""
        return min(self.tests, key=lambda test: (test.p, -test.chi2))


def cells(signal: Array, count: int) -> np.ndarray:
    """(n,) number of the cell, 0 ... count-1; the cells hold equally many samples; equal values share a cell."""
    edges = np.unique(np.quantile(signal, np.linspace(0.0, 1.0, count + 1)[1:-1]))
    return np.searchsorted(edges, signal, side="right")


def indicator(number: np.ndarray) -> Array:
    """(n, k): which of its k numbers each row has."""
    kept, place = np.unique(number, return_inverse=True)
    out = np.zeros((len(number), len(kept)))
    out[np.arange(len(number)), place] = 1.0
    return out


def features(signals: Mapping[str, Array], lags: Sequence[int]) -> dict[str, Array]:
    """Groups of features (n, k) over an equation's general signals; lags: how far back slopes are looked at."""
    names = list(signals)
    groups: dict[str, Array] = {}
    for name in names:
        kind = TIME_CELLS if name == "t" else SINGLE_CELLS
        groups[f"over {name}"] = indicator(cells(signals[name], kind))
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


General = list[tuple[str, str, list[Columns]]]  # (equation or entry, group, one {equation: (n, k)} per recording)


def general_features(machine: Machine, recordings: Sequence[Recording]) -> General:
    """All groups of features of all equations and entries."""
    found: General = []
    looked_over = [machine.generic(recording) for recording in recordings]
    for equation in dict.fromkeys(name for r in recordings for name in (*r.equations, *r.entries)):
        signals = [
            each.get(equation, {}) if equation in recording.equations or equation in recording.entries else {}
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
        for group, matrix in features(together, recordings[0].lags).items():
            columns = [
                _seen(recording, equation, matrix[start:stop]) if stop > start else {}
                for recording, start, stop in zip(recordings, ends[:-1], ends[1:], strict=True)
            ]
            found.append((equation, group, columns))
    return found


def _seen(recording: Recording, place: str, columns: Array) -> Columns:
    """What the equations see of columns in one of them, or at an entry."""
    if place in recording.entries:
        return recording.entries[place].respond(columns)
    return {place: columns}


def look(regression: Regression, general: General) -> Misfit:
    """Test the residual of a regression on general features."""
    groups = [(equation, group, regression.whitened(columns)) for equation, group, columns in general]
    tests, everything = [], []
    for equation, group, white in groups:
        beside = regression.beside(white)
        chi2, freedom = explained(beside, regression.residual)
        if freedom:
            tests.append(Test(equation, group, chi2, freedom, float(stats.chi2.sf(chi2, freedom))))
            everything.append(beside)
    if not tests:
        return Misfit([], 1.0, 0.0, np.zeros((regression.size, 0)))
    ordered = sorted(test.p for test in tests)
    p = min(1.0, ordered[0] * len(ordered))
    basis = orthonormal(np.hstack(everything))
    gained = float(((basis.T @ regression.residual) ** 2).sum())
    return Misfit(tests, p, max(0.0, gained - basis.shape[1]), basis)
