"""The step between the values of a channel in counts, found in the values themselves."""

import numpy as np
from numpy.typing import NDArray


def lattice_step(value: NDArray[np.float64]) -> float:
    """The finest step of a quantised or printed channel, (n,), in its unit; 0 when its values are not on a lattice."""
    different = np.unique(value[np.isfinite(value)])
    if len(different) < 4:
        return 0.0
    different = different[:20_000]
    gaps = np.diff(different)
    gaps = gaps[gaps > 1e-9 * (different[-1] - different[0])]
    small = gaps[gaps < 1.5 * np.percentile(gaps, 5.0)]
    step = float(np.median(small))
    counts = np.concatenate(([0.0], np.cumsum(np.round(gaps / step))))
    if (np.round(gaps / step) < 1.0).any():
        return 0.0
    places = np.concatenate(([0.0], np.cumsum(gaps)))
    step = float(counts @ places / (counts @ counts))
    off = places / step - counts
    return step if float(np.sqrt(np.mean((off - off.mean()) ** 2))) < 0.15 else 0.0
