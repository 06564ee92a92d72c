"""What an extension of the model gains on data that had no part in finding it."""

import dataclasses

import numpy as np

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.misfit import General
from ranger_sim.sysid.regression import Regression, orthonormal

BLOCK = 50  # rows of one block of the bootstrap: longer than any memory of the residual
DRAWS = 400


@dataclasses.dataclass(frozen=True)
class Gain:
    """fraction: of what can be explained at all; ci95 by bootstrap of blocks; rms of both, in deviations of noise."""

    fraction: float
    ci95: tuple[float, float]
    rms_before: float
    rms_after: float
    holdout: str

    @property
    def worse(self) -> bool:
        """True when the extended model predicts worse than the plain one."""
        return self.rms_after > self.rms_before


def errors(regression: Regression, values: dict[str, float]) -> Array:
    """Whitened residual (N,) of these parameters, found elsewhere."""
    theta = np.array([values.get(name, 0.0) for name in regression.names])
    return regression.response - regression.base @ theta


def measure(
    plain: Regression,
    before: dict[str, float],
    extended: Regression,
    after: dict[str, float],
    general: General,
    seed: int,
) -> Gain:
    """plain, extended: of the held-out recordings, with the whitening found in training; before, after: parameters."""
    first, second = errors(plain, before) ** 2, errors(extended, after) ** 2
    features = np.hstack([extended.whitened(columns) for _, _, columns in general])
    basis = orthonormal(np.hstack([extended.base, features]))
    rest = extended.response - basis @ (basis.T @ extended.response)
    floor = rest**2 * (len(rest) / max(1, len(rest) - basis.shape[1]))
    blocks = max(1, len(first) // BLOCK)
    sums = [
        np.add.reduceat(each[: blocks * BLOCK], np.arange(0, blocks * BLOCK, BLOCK)) for each in (first, second, floor)
    ]
    draws = generator(seed, "bootstrap of the gain").integers(0, blocks, (DRAWS, blocks))
    zero, one, least = (each[draws].sum(axis=1) for each in sums)
    achievable = np.maximum(zero - least, 1e-9)
    fractions = (zero - one) / achievable
    total = float(sum(sums[0]) - sum(sums[2]))
    fraction = float((sums[0].sum() - sums[1].sum()) / total) if total > 0.0 else 0.0
    low, high = np.quantile(fractions, [0.025, 0.975])
    return Gain(
        fraction,
        (float(low), float(high)),
        float(np.sqrt(np.mean(first))),
        float(np.sqrt(np.mean(second))),
        ", ".join(recording.table.name for recording in plain.recordings),
    )
