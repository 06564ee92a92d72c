"""Is anything left that can be predicted? A flexible predictor on data that it was not fitted to, against chance.

Whatever can be predicted from the machine's signals, on rows that had no part in the fit, is an error of the model;
whatever cannot is noise. The predictor is a ridge over random cosines of the signals (Rahimi and Recht 2007), bounded
everywhere and 0 outside its training; its ridge may be infinite, which predicts nothing. Chance is what the same
predictor reaches on surrogates of the base's residual: noise of the same memory without any cause.
"""

import dataclasses
import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid import likelihood, noise
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Machine, Recording
from ranger_sim.sysid.regression import Regression, reduced

SCALES = (0.3, 0.7, 1.5, 3.0)  # lengths of the cosines, in deviations of a signal
PER_SIGNAL, PER_PAIR, TOGETHER = 12, 8, 24  # cosines over one signal, over two, over all
RIDGES = (1e-3, 1e-2, 1e-1, 1.0, 10.0)  # of the mean square of a feature; and an infinite one
BLOCKS = 10
BEYOND = 0.02  # of a signal's training range, beyond which a row is outside of it
WORTH = 0.05  # of the residual's square: less is not a reason for another band
HIDDEN = 1e-4  # of an effect's square: when the base explains all but this, the data do not show it
SURROGATES = 199  # and as many for every further equation, so that their least chance together stays the same
MOST_ROWS = 3000  # that count in the test: slower than every n-th row nothing is lost below the band's edge


@dataclasses.dataclass(frozen=True)
class Predicted:
    """Of one equation. share: of the residual's square that is predicted on held-out blocks, 0 ... 1; p: by chance;
    stretches: the recording's length over the noise's correlation time."""

    equation: str
    share: float
    p: float
    stretches: float


@dataclasses.dataclass(frozen=True)
class Cosines:
    """Bounded features of signals, and straight lines that end at the training's limits."""

    names: tuple[str, ...]
    mean: Array
    size: Array
    low: Array
    high: Array
    turns: Array
    phases: Array

    def __call__(self, signals: Mapping[str, Array]) -> Array:
        """(n, k)."""
        raw = np.column_stack([signals[name] for name in self.names])
        inside = np.clip(raw, self.low, self.high)
        scaled = (inside - self.mean) / self.size
        far = np.any(np.abs(raw - inside) > BEYOND * (self.high - self.low), axis=1)
        out = np.hstack([np.cos(scaled @ self.turns + self.phases), scaled])
        out[far] = 0.0  # nothing is known there
        return out


def cosines(signals: Sequence[Mapping[str, Array]], seed: int) -> Cosines:
    """Features that suit these recordings."""
    names = tuple(name for name in signals[0] if all(name in each for each in signals))
    together = np.vstack([np.column_stack([each[name] for name in names]) for each in signals])
    random = generator(seed, "cosines of the flexible predictor")
    count = len(names)
    groups: list[tuple[int, ...]] = [(one,) for one in range(count) for _ in range(PER_SIGNAL)]
    groups += [pair for pair in itertools.combinations(range(count), 2) for _ in range(PER_PAIR)]
    groups += [tuple(range(count))] * TOGETHER
    turns = np.zeros((count, len(groups)))
    for number, group in enumerate(groups):
        turns[list(group), number] = random.normal(size=len(group)) / SCALES[number % len(SCALES)]
    phases = random.uniform(0.0, 2.0 * np.pi, len(groups))
    size = np.std(together, axis=0)
    low, high = np.min(together, axis=0), np.max(together, axis=0)
    return Cosines(names, np.mean(together, axis=0), np.where(size > 0.0, size, 1.0), low, high, turns, phases)


@dataclasses.dataclass
class Predictor:
    """Features of every equation, by the machine's general signals, and how they reach its rows."""

    machine: Machine
    made: dict[str, Cosines]  # by equation or entry

    def columns(self, recordings: Sequence[Recording]) -> dict[str, Array]:
        """By equation (rows, k) over all recordings, in their band."""
        parts: dict[str, list[Array]] = {}
        for recording in recordings:
            general = self.machine.generic(recording)
            here: dict[str, list[Array]] = {name: [] for name in recording.equations}
            for place, features in self.made.items():
                wide = features.turns.shape[1] + len(features.names)
                if place not in general:
                    continue
                raw = features(general[place])
                seen = recording.entries[place].respond(raw) if place in recording.entries else {place: raw}
                for name, columns in here.items():
                    columns.append(seen.get(name, np.zeros((len(recording.table), wide))))
            for name, features_here in here.items():
                if features_here:
                    parts.setdefault(name, []).append(reduced(recording, np.hstack(features_here), name))
        return {name: np.vstack(each) for name, each in parts.items()}


def predictor(machine: Machine, recordings: Sequence[Recording], seed: int, without: Collection[str] = ()) -> Predictor:
    """The flexible predictor for this machine and these recordings; without: signals that it does not use."""
    general = [
        {
            place: {name: signal for name, signal in signals.items() if name not in without}
            for place, signals in machine.generic(recording).items()
        }
        for recording in recordings
    ]
    places = [name for name in general[0] if all(name in each and each[name] for each in general)]
    return Predictor(machine, {name: cosines([each[name] for each in general], seed) for name in places})


def share(regression: Regression, features: Mapping[str, Array]) -> float:
    """The largest share, of the equations, of a residual's square that is predicted on held-out blocks."""
    found = 0.0
    for name, part in regression.parts.items():
        if name in features and np.count_nonzero(regression.good[name]) >= 4 * BLOCKS:
            rows, residual, used = _rows(regression, name)
            found = max(found, float(_held_out(features[name][rows], used, residual[rows, None])[0]))
    return found


def _rows(regression: Regression, name: str) -> tuple[np.ndarray, Array, Array]:
    """(rows of an equation that a test counts, its residual (n,), the base's columns in those rows)."""
    part = regression.parts[name]
    good = np.flatnonzero(regression.good[name])
    rows = good[:: max(1, len(good) // MOST_ROWS)]
    residual = part.response - part.measured @ np.array([regression.values[each] for each in regression.names])
    used = part.stand_in[rows]  # a feature must not find a column's own noise, which is in the residual
    return rows, residual, used[:, np.any(used != 0.0, axis=0)]


def test(regression: Regression, features: Mapping[str, Array], seed: int) -> list[Predicted]:
    """Each equation's residual against chance. features: by equation, over all of the regression's rows."""
    found = []
    count = (SURROGATES + 1) * len(regression.parts) - 1
    noises = likelihood.own_noise(regression).whitening
    for name in regression.parts:
        good = regression.good[name]
        if name not in features or np.count_nonzero(good) < 4 * BLOCKS:
            continue
        own = noises[name]
        drawn = noise.surrogates(own.coefficients, own.deviation, len(good), count, seed, f"chance of {name}")
        rows, residual, used = _rows(regression, name)
        shares = _held_out(features[name][rows], used, np.column_stack([residual[rows], drawn[rows]]))
        memory = noise.correlation_time(own.coefficients)
        p = (1.0 + float(np.count_nonzero(shares[1:] >= shares[0]))) / (1.0 + count)
        found.append(Predicted(name, max(0.0, float(shares[0])), p, np.count_nonzero(good) / memory))
    return found


class _Fold:
    """Features less a base's part, fitted on some rows, held against others: each ridge by one decomposition."""

    def __init__(self, features: Array, base: Array, fitted: np.ndarray, held: np.ndarray) -> None:
        scale = np.linalg.norm(base[fitted], axis=0)
        scale = np.where(scale > 0.0, scale, 1.0)
        self.fitted, self.held = fitted, held
        self.basis, self.base_held = np.linalg.pinv(base[fitted] / scale), base[held] / scale
        self.base_fitted = base[fitted] / scale
        own = self.basis @ features[fitted]
        rest = features[fitted] - self.base_fitted @ own
        size = np.std(rest, axis=0)
        self.size = np.where(size > 1e-9 * np.max(size, initial=1e-300), size, np.inf)
        self.rest = rest / self.size
        power, self.vectors = np.linalg.eigh(self.rest.T @ self.rest)
        self.power = np.maximum(power, 0.0)
        self.turned = ((features[held] - self.base_held @ own) / self.size) @ self.vectors

    def missed(self, residuals: Array) -> tuple[Array, Array]:
        """Residuals (n, m) less the base's part, on the fitted rows and on the held ones."""
        own = self.basis @ residuals[self.fitted]
        return residuals[self.fitted] - self.base_fitted @ own, residuals[self.held] - self.base_held @ own

    def squares(self, residuals: Array) -> tuple[Array, Array]:
        """((m,) square of what the base misses on the held rows, (ridges, m) and with the features)."""
        missed, missed_held = self.missed(residuals)
        along = self.vectors.T @ (self.rest.T @ missed)
        whole, met, gram = np.sum(missed_held**2, axis=0), self.turned.T @ missed_held, self.turned.T @ self.turned
        left = []
        for ridge in RIDGES:  # |m - T s|^2 by its products, a third of the rows' own
            shrunk = self._shrunk(along, ridge)
            left.append(whole + np.sum((gram @ shrunk - 2.0 * met) * shrunk, axis=0))
        return whole, np.stack(left)

    def coefficients(self, residual: Array, ridge: float) -> Array:
        """(k,) of the features for a residual (n,)."""
        missed, _ = self.missed(residual[:, None])
        along = self.vectors.T @ (self.rest.T @ missed)
        return np.asarray((self.vectors @ self._shrunk(along, ridge))[:, 0] / self.size)

    def _shrunk(self, along: Array, ridge: float) -> Array:
        return np.asarray(along / (self.power + ridge * len(self.rest))[:, None])


def _folds(features: Array, base: Array) -> Iterator[_Fold]:
    block = np.arange(len(features)) * BLOCKS // len(features)
    for each in range(BLOCKS):
        yield _Fold(features, base, block != each, block == each)


def _held_out(features: Array, base: Array, residuals: Array) -> Array:
    """(m,) share of each residual (n, m) that is predicted on blocks left out, at the best ridge for each."""
    whole, left = np.zeros(residuals.shape[1]), np.zeros((len(RIDGES), residuals.shape[1]))
    for fold in _folds(features, base):
        missed, squares = fold.squares(residuals)
        whole, left = whole + missed, left + squares
    return np.asarray(np.max(1.0 - left / np.maximum(whole, 1e-300), axis=0))


def learned(features: Array, base: Array, residual: Array) -> Array:
    """(k,) coefficients of features with the base's columns, at the ridge that predicts best on blocks left out.

    All zero where no ridge predicts anything.
    """
    whole, left = 0.0, np.zeros(len(RIDGES))
    for fold in _folds(features, base):
        missed, squares = fold.squares(residual[:, None])
        whole, left = whole + float(missed[0]), left + squares[:, 0]
    best = int(np.argmin(left))
    if left[best] >= whole:
        return np.zeros(features.shape[1])
    everything = np.ones(len(features), dtype=bool)
    return _Fold(features, base, everything, ~everything).coefficients(residual, RIDGES[best])
