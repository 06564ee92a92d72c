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
from ranger_sim.sysid.regression import Regression, Whitening, reduced

SCALES = (0.3, 0.7, 1.5, 3.0)  # lengths of the cosines, in deviations of a signal
PER_SIGNAL, PER_PAIR, TOGETHER = 12, 8, 24  # cosines over one signal, over two, over all
RIDGES = (1e-3, 1e-2, 1e-1, 1.0, 10.0)  # of the mean square of a feature; and an infinite one
BLOCKS = 10
BEYOND = 0.02  # of a signal's training range, beyond which a row is outside of it
WORTH = 0.05  # of the residual's square: less is not a reason for another band
FIRST = 99  # surrogates that are tried first; no more are where so many of them do as well, or where all are far below:
PLAIN, FAR = 8, 10.0  # deviations above their mean
SURROGATES = 199  # and as many for every further equation, so that their least chance together stays the same
RANK = 1e-6  # of the longest direction of a base: a shorter one is rounding
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


def test(regression: Regression, features: Mapping[str, Array], seed: int, worth: float = 0.0) -> list[Predicted]:
    """Each equation's residual against chance. features: by equation, over all of the regression's rows.

    worth: when no share exceeds it, chance, which costs some hundred times as much, is not asked (p 1).
    """
    found = []
    predicted = list(_predicted(regression, features))
    asked = any(share > worth for *_, share in predicted)
    count = (SURROGATES + 1) * len(regression.parts) - 1
    noises = likelihood.own_noise(regression).whitening
    for name, ridge, rows, share in predicted:
        own, good = noises[name], regression.good[name]
        p = 1.0
        if asked:
            chance = ridge.shares(_drawn(own, len(good), FIRST, seed, f"chance of {name}")[rows])
            p = 1.0 / (1.0 + count)
        if asked and share < np.mean(chance) + FAR * np.std(chance):
            if np.count_nonzero(chance >= share) < PLAIN:
                more = _drawn(own, len(good), count - FIRST, seed, f"further chance of {name}")[rows]
                chance = np.concatenate((chance, ridge.shares(more)))
            p = (1.0 + float(np.count_nonzero(chance >= share))) / (1.0 + len(chance))
        memory = noise.correlation_time(own.coefficients)
        found.append(Predicted(name, max(0.0, share), p, np.count_nonzero(good) / memory))
    return found


def _drawn(own: Whitening, rows: int, count: int, seed: int, name: str) -> Array:
    """(rows, count) samples of a noise."""
    return noise.surrogates(own.coefficients, own.deviation, rows, count, seed, name)


def _predicted(
    regression: Regression, features: Mapping[str, Array]
) -> Iterator[tuple[str, "_Ridge", np.ndarray, float]]:
    """(equation, its ridges, rows that count in the test, share of its residual's square that they predict)."""
    values = np.array([regression.values[each] for each in regression.names])
    for name, part in regression.parts.items():
        good = np.flatnonzero(regression.good[name])
        if name not in features or len(good) < 4 * BLOCKS:
            continue
        rows = good[:: max(1, len(good) // MOST_ROWS)]
        # stand-ins: less of a measured column, a feature would show that column's noise, which is in the residual
        ridge = _Ridge(features[name][rows], part.stand_in[rows])
        residual = part.response[rows] - part.measured[rows] @ values
        yield name, ridge, rows, float(ridge.shares(residual[:, None])[0])


class _Ridge:
    """Ridges over features of which the base's part is taken off, fitted on all blocks but one and held against it.

    The base is taken off all rows at once: a block of its own would not determine every parameter.
    """

    def __init__(self, features: Array, base: Array) -> None:
        """features: (n, k); base: (n, p)."""
        self.basis = _orthonormal(base)
        ends = np.arange(BLOCKS + 1) * len(features) // BLOCKS
        self.block = [np.arange(low, high) for low, high in itertools.pairwise(ends)]
        self.features = self.off(features)
        size = np.sqrt(np.mean(self.features**2, axis=0))
        self.size = np.where(size > likelihood.HIDDEN * np.sqrt(np.mean(features**2, axis=0)), size, np.inf)
        self.features = self.features / self.size
        self.squares = [self.features[rows].T @ self.features[rows] for rows in self.block]
        self.whole = np.sum(self.squares, axis=0)
        self.turns = [np.linalg.eigh(self.whole - each) for each in self.squares]
        self.turned = [
            vectors.T @ square @ vectors for square, (_, vectors) in zip(self.squares, self.turns, strict=True)
        ]

    def off(self, columns: Array) -> Array:
        """Columns (n, m) less the base's part."""
        return np.asarray(columns - self.basis @ (self.basis.T @ columns))

    def errors(self, residuals: Array) -> tuple[Array, Array]:
        """((m,) square of residuals (n, m), (ridges, m) of what is left on blocks without a part in the fit)."""
        residuals = self.off(residuals)
        products = [self.features[rows].T @ residuals[rows] for rows in self.block]
        whole = np.sum(products, axis=0)
        total = np.sum(residuals**2, axis=0)
        left = np.tile(total, (len(RIDGES), 1))
        for rows, turned, product, (power, vectors) in zip(self.block, self.turned, products, self.turns, strict=True):
            along, held = vectors.T @ (whole - product), vectors.T @ product
            count = len(residuals) - len(rows)
            for number, ridge in enumerate(RIDGES):
                found = along / (np.maximum(power, 0.0) + ridge * count)[:, None]
                left[number] += np.sum(found * (turned @ found - 2.0 * held), axis=0)
        return total, left

    def shares(self, residuals: Array) -> Array:
        """(m,) share of each residual (n, m) that is predicted on blocks left out, at the best ridge for each."""
        total, left = self.errors(residuals)
        return np.asarray(np.max(1.0 - left / np.maximum(total, 1e-300), axis=0))

    def coefficients(self, residual: Array) -> Array:
        """(k,) of the features for a residual (n,), at the ridge that predicts best; 0 where none predicts anything."""
        total, left = self.errors(residual[:, None])
        best = int(np.argmin(left[:, 0]))
        if left[best, 0] >= total[0]:
            return np.zeros(len(self.size))
        power, vectors = np.linalg.eigh(self.whole)
        along = vectors.T @ (self.features.T @ self.off(residual[:, None])[:, 0])
        return np.asarray(vectors @ (along / (np.maximum(power, 0.0) + RIDGES[best] * len(residual))) / self.size)


def _orthonormal(base: Array) -> Array:
    """(n, r) orthonormal basis of a base's columns (n, p), without directions that only rounding determines."""
    lengths = np.linalg.norm(base, axis=0)
    basis, sizes, _ = np.linalg.svd(base[:, lengths > 0.0] / lengths[lengths > 0.0], full_matrices=False)
    return np.asarray(basis[:, sizes > RANK * np.max(sizes, initial=0.0)])


def learned(features: Array, base: Array, residual: Array) -> Array:
    """(k,) coefficients of features with the base's columns, at the ridge that predicts best on blocks left out.

    All zero where no ridge predicts anything.
    """
    return _Ridge(features, base).coefficients(residual)
