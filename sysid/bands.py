"""The band of frequencies in which a machine's equations are judged.

An equation holds under any filter that acts on both of its sides alike. At the full rate a fit that whitens its noise
weighs the fast end, where sensors ring, columns are derivatives of noise, and no cause of the catalogue acts; then its
parameters predict other data worse than plain least squares do. The band is the widest one in which they do not: each
next one is an octave narrower.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ranger_sim.sysid import noise
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Recording
from ranger_sim.sysid.regression import Noise, Part, Regression, Whitening, innovations

MOST_ROWS = 6000  # of all recordings; a wider band says nothing more of causes, and costs time
FEWEST_ROWS = 150  # of all recordings: below it a band has too few rows for candidates and noise
WORSE = 1.1  # times the plain fit's error on held-out blocks
BLOCKS = 5
AGREE = 0.9  # correlation of a measured column with what moves as it does: below it the column is mostly noise
OCTAVES = 3
GAUSSIAN = 0.1325  # of the rows' frequency over the width in samples: -3 dB of a Gaussian
OVER = 2.4  # kept rows' frequency over the band's edge


@dataclasses.dataclass(frozen=True)
class Band:
    """edge_hz: -3 dB; None for rows as they are."""

    edge_hz: float | None

    def of(self, recording: Recording) -> Recording:
        """The recording with both sides of its equations in this band; a simulator's errors stay as they are."""
        if self.edge_hz is None or recording.entries:
            return recording
        rate_hz = 1.0 / recording.table.step_s
        width, every = GAUSSIAN * rate_hz / self.edge_hz, max(1, int(rate_hz / (OVER * self.edge_hz)))
        return dataclasses.replace(recording, width=width, every=every)


def choose(recordings: Sequence[Recording]) -> list[Band]:
    """The widest band in which a whitened fit predicts blocks that it was not fitted to about as well as a plain one,
    and the two octaves below it. A band in which a measured column is mostly noise does not count.

    Only the full one for a simulator's errors, which are white by construction; the narrowest where none is good.
    """
    full = Band(None)
    if any(recording.entries or recording.repeats for recording in recordings):
        return [full]
    rows = sum(len(recording.table) for recording in recordings)
    rate_hz = 1.0 / recordings[0].table.step_s
    edge_hz = rate_hz / OVER / 2.0
    tried = [full]
    while rows * OVER * edge_hz / rate_hz >= FEWEST_ROWS:
        tried.append(Band(edge_hz))
        edge_hz /= 2.0
    fitting = [each for each in tried if rows * _kept(each, rate_hz) <= MOST_ROWS] or tried[-1:]
    for band in fitting:
        regression = plain([band.of(recording) for recording in recordings])
        if all(_ratio(part) <= WORSE and _agrees(part) for part in regression.parts.values()):
            first = fitting.index(band)
            return fitting[first : first + OCTAVES]
    return fitting[-1:]


def _kept(band: Band, rate_hz: float) -> float:
    return 1.0 if band.edge_hz is None else 1.0 / max(1, int(rate_hz / (OVER * band.edge_hz)))


def plain(recordings: Sequence[Recording]) -> Regression:
    """Regression of rows that count alike within an equation; each equation in its own rms."""
    sizes: dict[str, Whitening] = {}
    for name in dict.fromkeys(name for recording in recordings for name in recording.equations):
        there = [recording.equations[name] for recording in recordings if name in recording.equations]
        values = np.concatenate([each.response[each.valid] for each in there])
        size = float(np.std(values)) if len(values) else 0.0
        sizes[name] = Whitening(np.zeros(0), size or 1.0)
    return Regression(recordings, noise=Noise(sizes))


def _ratio(part: Part) -> float:
    """Error of a whitened fit over that of a plain one, on blocks that neither was fitted to."""
    good = part.valid & ~part.starts
    there = np.any(part.measured != 0.0, axis=0)
    y, x, z = part.response, part.measured[:, there], part.stand_in[:, there]
    if not np.any(good) or not x.shape[1]:
        return 1.0
    memory = noise.autoregression(y - x @ fitted(z[good], x[good], y[good]), good & _same_run(part))
    white_y, white_x, white_z = (innovations(memory, each) for each in (y, x, z))
    block = np.arange(len(y)) * BLOCKS // len(y)
    errors = np.zeros(2)
    for each in range(BLOCKS):
        used, held = good & (block != each), good & (block == each)
        for number, (a, b, c) in enumerate(((z, x, y), (white_z, white_x, white_y))):
            errors[number] += np.sum((y[held] - x[held] @ fitted(a[used], b[used], c[used])) ** 2)
    return float(np.sqrt(errors[1] / max(errors[0], 1e-300)))


def _agrees(part: Part) -> bool:
    """True where no column of an equation is mostly the noise of its own measurement, by its stand-in."""
    good = part.valid & ~part.starts
    for measured, other in zip(part.measured[good].T, part.stand_in[good].T, strict=True):
        lengths = float(np.linalg.norm(measured) * np.linalg.norm(other))
        if lengths > 0.0 and float(measured @ other) < AGREE * lengths:
            return False
    return True


def _same_run(part: Part) -> np.ndarray:
    """False for the first row of a run, so that no stretch of rows spans a gap."""
    return np.diff(part.run, prepend=part.run[:1]) == 0


def fitted(stand_ins: Array, columns: Array, values: Array) -> Array:
    """Coefficients (k,) of noisy columns (n, k) by stand-ins (n, k) that have not their noise; of values (n,)."""
    if np.array_equal(stand_ins, columns):  # then without squaring, which loses half of the digits
        return least_squares(columns, values)
    scale = np.linalg.norm(stand_ins, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    sized = (stand_ins / scale).T
    return np.asarray(np.linalg.lstsq(sized @ (columns / scale), sized @ values, rcond=1e-10)[0] / scale)


def least_squares(columns: Array, values: Array) -> Array:
    """Coefficients by least squares, columns at one scale."""
    scale = np.linalg.norm(columns, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    found = np.linalg.lstsq(columns / scale, values, rcond=1e-10)[0]
    return np.asarray((found.T / scale).T)
