"""Noise with memory: autoregressions of a residual by Burg's method, and surrogates of the same noise.

Order by the Bayesian information criterion. Burg's method is always stable, works on short stretches, and several
stretches count together, so that gaps cost only the rows after them.
"""

from collections.abc import Sequence

import numpy as np
from scipy import signal

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Array

MOST = 20  # largest order
SHARE = 20  # rows per coefficient, at least
FOLLOWED = 0.5  # of the rows, at least, that have a memory's rows before them without a gap
SETTLE = 2000  # samples that a surrogate runs before it counts: longer than any memory that an order of 20 can show


def stretches(good: np.ndarray, shortest: int = 2) -> list[slice]:
    """Unbroken stretches of rows that count, (n,) flags, of at least `shortest` rows."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], good.astype(int), [0]))))
    return [slice(a, b) for a, b in edges.reshape(-1, 2).tolist() if b - a >= shortest]


def burg(parts: Sequence[Array], most: int = MOST) -> list[tuple[Array, float]]:
    """(coefficients (p,), variance of the innovations) of every order p = 0 ... most, for the stretches together.

    r[t] = sum of coefficients[i] r[t - 1 - i] + innovation.
    """
    forward = [np.asarray(part, dtype=float) for part in parts]
    backward = [part.copy() for part in forward]
    variance = sum(float(part @ part) for part in forward) / max(1, sum(map(len, forward)))
    coefficients = np.zeros(0)
    found = [(coefficients, variance)]
    for _ in range(most):
        ahead = [part[1:] for part in forward]
        behind = [part[:-1] for part in backward]
        power = sum(float(a @ a + b @ b) for a, b in zip(ahead, behind, strict=True))
        if power <= 0.0:
            break
        reflection = 2.0 * sum(float(a @ b) for a, b in zip(ahead, behind, strict=True)) / power
        forward = [a - reflection * b for a, b in zip(ahead, behind, strict=True)]
        backward = [b - reflection * a for a, b in zip(ahead, behind, strict=True)]
        coefficients = np.concatenate((coefficients - reflection * coefficients[::-1], [reflection]))
        variance *= 1.0 - reflection * reflection
        found.append((coefficients, variance))
    return found


def autoregression(residual: Array, good: np.ndarray, most: int = MOST) -> Array:
    """Coefficients (p,) of the noise of a residual (n,) on its rows that count; p by the information criterion.

    Gaps limit p: a row counts only with p rows before it.
    """
    parts = [residual[each] for each in stretches(good)]
    lengths = np.array([len(part) for part in parts], dtype=int)
    rows = int(lengths.sum())
    followed = [int(np.sum(np.maximum(lengths - order, 0))) for order in range(1, most + 1)]
    longest = sum(1 for left in followed if left >= FOLLOWED * np.count_nonzero(good))
    tried = burg(parts, min(longest, rows // SHARE))
    criteria = [rows * np.log(max(left, 1e-300)) + len(found) * np.log(max(rows, 2)) for found, left in tried]
    return tried[int(np.argmin(criteria))][0]


def correlation_time(coefficients: Array) -> float:
    """Samples over which the noise of an autoregression is correlated: its spectrum at 0 over its variance."""
    return float(np.sum(np.abs(autocorrelation(coefficients))))


def autocorrelation(coefficients: Array) -> Array:
    """Autocorrelation at whole lags, both ways, as far as it is above a hundredth."""
    impulse = signal.lfilter([1.0], np.concatenate(([1.0], -coefficients)), np.eye(1, SETTLE)[0])
    one_way = signal.fftconvolve(impulse, impulse[::-1])[SETTLE - 1 :]
    one_way /= one_way[0]
    last = int(np.flatnonzero(np.abs(one_way) > 0.01)[-1])
    return np.concatenate((one_way[last:0:-1], one_way[: last + 1]))


def surrogates(coefficients: Array, deviation: float, rows: int, count: int, seed: int, name: str) -> Array:
    """(rows, count) samples of the noise; deviation: of its innovations; name: of the stream of random numbers."""
    random = generator(seed, name)
    shocks = random.normal(scale=deviation, size=(rows + SETTLE, count))
    if not len(coefficients):
        return np.asarray(shocks[SETTLE:])
    return np.asarray(signal.lfilter([1.0], np.concatenate(([1.0], -coefficients)), shocks, axis=0)[SETTLE:])
