"""Noise of a balance as its channels' noise makes it: each channel's under the weights with which it reaches a row.

A position's noise, differentiated twice, has next to no power at low frequencies, where causes are, and the whole of
it at high ones. An autoregression of some twenty rows has no such dip, and then no cause is seen. The covariance of
rows is banded here, by two deviations and a memory of the channels' noise; rows that do not count are left out of it,
and no other row is lost by that. The whitened rows are those of its Cholesky factor: each less its forecast from all
before it.
"""

import dataclasses
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy import linalg, optimize

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Array

MEMORIES = (0.0, 0.5, 0.8, 0.9)  # of a channel's noise from row to row
FORGOTTEN = 3e-3  # of a memory: less is not followed
PAYS = 1.0  # of -2 log likelihood per recording, by which a longer memory must be likelier
LEAST, MOST = -16.0, 8.0  # logarithm of the first channel's share over the other's
PASSES = 3  # of fit and noise
CLOSE = 0.1  # of that logarithm
REACH = 4.0  # widths of a Gaussian
WORSE = 0.1  # of -2 log likelihood per row: the numbers of an autoregression, ten times as many, fit so much more


def autocovariances(sources: Sequence[Array], memory: float, width: float, every: int) -> Array:
    """(channels, lags) of noise of each channel, 1 at lag 0. sources: weights of its rows in one row of the balance.

    memory: of the channels' noise; width: of a Gaussian in rows; every: of so many rows one is kept.
    """
    reach = int(np.ceil(REACH * width))
    bell = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(width, 1e-9)) ** 2)
    count = 1 + (int(np.log(FORGOTTEN) / np.log(memory)) if memory > 0.0 else 0)
    found = []
    for weights in sources:
        kernel = np.convolve(np.convolve(weights, bell), memory ** np.arange(count))
        both = np.correlate(kernel, kernel, "full")[len(kernel) - 1 :: every]
        found.append(both / both[0])
    longest = max(map(len, found))
    return np.array([np.pad(each, (0, longest - len(each))) for each in found])


def factor(covariance: Array, rows: np.ndarray, run: np.ndarray) -> Array:
    """Lower Cholesky factor (bands, n) of rows with these numbers (n,), alike in a run, apart in different ones."""
    bands = min(len(covariance), len(rows))
    banded = np.zeros((bands, len(rows)))
    for band in range(bands):
        apart = rows[band:] - rows[: len(rows) - band]
        near = (apart < len(covariance)) & (run[band:] == run[: len(rows) - band])
        banded[band, : len(rows) - band] = np.where(near, covariance[np.minimum(apart, len(covariance) - 1)], 0.0)
    return np.asarray(linalg.cholesky_banded(banded, lower=True, check_finite=False))


def whitened(lower: Array, columns: Array) -> Array:
    """Rows (n,) or (n, k) by a factor of their covariance."""
    return np.asarray(linalg.solve_banded((len(lower) - 1, 0), lower, columns, check_finite=False))


def fitted(
    residual: Array, rows: np.ndarray, run: np.ndarray, sources: Sequence[Array], width: float, every: int
) -> tuple[Array, Array, Array]:
    """(covariance by lag, its factor, whitened residual), the likeliest.

    The logarithms of the factor's diagonal have the mean 0.
    residual: (n,) in rows with these numbers, of these runs. sources: of two channels.
    """
    best: tuple[float, Array] | None = None
    for memory in MEMORIES:
        parts = autocovariances(sources, memory, width, every)

        def mixed(odds: float, parts: Array = parts) -> Array:
            share = 1.0 / (1.0 + np.exp(-odds))
            return np.asarray(share * parts[0] + (1.0 - share) * parts[1])

        def unlikely(odds: float, mixed=mixed) -> float:  # type: ignore[no-untyped-def]
            lower = factor(mixed(odds), rows, run)
            white = whitened(lower, residual)
            return float(len(rows) * np.log(max(float(np.mean(white**2)), 1e-300)) + 2.0 * np.sum(np.log(lower[0])))

        found = optimize.minimize_scalar(unlikely, bounds=(LEAST, MOST), method="bounded", options={"xatol": CLOSE})
        if best is None or found.fun < best[0] - PAYS:
            best = (float(found.fun), mixed(float(found.x)))
    assert best is not None
    lower = factor(best[1], rows, run)
    size = float(np.exp(np.mean(np.log(lower[0]))))
    return best[1] / size**2, lower / size, whitened(lower / size, residual)


class Rows(Protocol):
    """An equation's rows: flags of those that count (n,), and the run of each."""

    run: np.ndarray
    sources: tuple[Array, ...]
    width: float
    every: int

    @property
    def counted(self) -> np.ndarray:
        """(n,) rows that count."""


@dataclasses.dataclass(frozen=True)
class OfChannels:
    """covariance: by lag; rows: (m,) numbers of those that count; factor: of their covariance, the mean logarithm of
    its diagonal 0; white: (m,) the residual by it; residual: (n,) of the fit in this noise."""

    covariance: Array
    rows: np.ndarray
    factor: Array
    white: Array
    residual: Array

    def likely(self, shocks: Array, counted: np.ndarray) -> bool:
        """True where this noise suits about as well as an autoregression with these innovations (n,) in `counted`."""
        here = counted[self.rows]
        if not np.any(here):
            return True
        own = float(
            np.log(max(float(np.mean(self.white[here] ** 2)), 1e-300)) + 2.0 * np.mean(np.log(self.factor[0, here]))
        )
        return own <= float(np.log(max(float(np.mean(shocks[counted] ** 2)), 1e-300))) + WORSE


def settled(part: Rows, columns: Array, stand_ins: Array, residual: Array) -> OfChannels:
    """The noise in which a fit leaves just it. columns, stand_ins: (n, k); residual: (n,) of any fit of the columns.

    Least squares without the noise leave errors of coefficients at low frequencies, larger than the noise is there.
    """
    rows = np.flatnonzero(part.counted)
    run, x, z = part.run[rows], columns[rows], stand_ins[rows]
    for _ in range(PASSES):
        covariance, lower, white = fitted(residual[rows], rows, run, part.sources, part.width, part.every)
        if not columns.shape[1]:
            break
        wide, instead = whitened(lower, x), whitened(lower, z)
        scale = np.linalg.norm(instead, axis=0)
        scale = np.where(scale > 0.0, scale, 1.0)
        instead /= scale
        found = np.linalg.lstsq(instead.T @ (wide / scale), instead.T @ white, rcond=1e-10)[0] / scale
        residual, white = residual - columns @ found, white - wide @ found
    return OfChannels(covariance, rows, lower, white, residual)


def correlation_time(covariance: Array) -> float:
    """Samples over which the noise is correlated."""
    return float(1.0 + 2.0 * np.sum(np.abs(covariance[1:])) / covariance[0])


def surrogates(covariance: Array, deviation: float, rows: int, count: int, seed: int, name: str) -> Array:
    """(rows, count) samples of the noise; name: of the stream of random numbers."""
    whole = rows + 2 * len(covariance)
    around = np.zeros(whole)
    around[: len(covariance)] = covariance
    around[-len(covariance) + 1 :] += covariance[:0:-1]
    gain = np.sqrt(np.maximum(np.fft.rfft(around).real, 0.0))
    shocks = generator(seed, name).normal(scale=deviation, size=(whole, count))
    return np.asarray(np.fft.irfft(np.fft.rfft(shocks, axis=0) * gain[:, None], n=whole, axis=0)[:rows])
