"""Gain of an extension of the model on data that were not used to find it."""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import stats

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.misfit import General
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.naming import coefficients as coefficients_of
from ranger_sim.sysid.regression import Regression, orthonormal

BLOCK = 50  # rows of one block of the bootstrap: longer than any memory of the residual
LONG_BLOCK_S = 1.0  # where the residual is not whitened: chosen by us, in which a leg forgets
FEWEST_BLOCKS = 8  # of any held-out data: of one block every draw is the same
DRAWS = 400
MORE = 0.01  # chance at which general features count as seeing more than the effects


@dataclasses.dataclass(frozen=True)
class Gain:
    """fraction: of what can be explained at all; ci95 by bootstrap of blocks; rms of both, in deviations of noise."""

    fraction: float
    ci95: tuple[float, float]
    rms_before: float
    rms_after: float
    holdout: str
    chi2_won: float = 0.0  # by which the extended model is nearer
    chi2_expected: float = 0.0  # what the last of the effects would win were it there as training has it

    @property
    def worse(self) -> bool:
        """True when the extended model predicts worse than the plain one."""
        return self.rms_after > self.rms_before


def measure(
    plain: Regression, named: Sequence[Named], values: Mapping[str, float], general: General, seed: int
) -> Gain:
    """plain: the held-out recordings in the base model, whitened as in training. values: found in training.

    The machine's own parameters are fitted anew, with and without the effects: temperature and wear of another day are
    no fault of the extension. Its coefficients stay those of training; only the phase of a periodic effect is free,
    for an incremental encoder starts anywhere.
    """
    before = plain.residual
    after = before.copy()
    columns = []
    expected = 0.0
    for each in named:
        made = [each.effect.columns(recording, each.shape, plain.values) for recording in plain.recordings]
        made = [{name: column for name, column in columns.items() if name in plain.equations} for columns in made]
        if not any(made):
            continue
        beside = plain.columns(made)
        columns.append(beside)
        coefficients = np.array([values[name] for name in each.coefficients])
        if each.effect.phase_is_free:
            here = coefficients_of(beside, before).reshape(-1, 2)
            size = np.linalg.norm(coefficients.reshape(-1, 2), axis=1) / np.maximum(
                np.linalg.norm(here, axis=1), 1e-300
            )
            coefficients = (here * size[:, None]).ravel()
        free = [name in each.effect.free for name in each.effect.coefficients]
        if any(free):
            fixed = np.where(free, 0.0, coefficients)
            coefficients = fixed.copy()
            coefficients[free] = coefficients_of(beside[:, free], after - beside @ fixed)
        after = after - beside @ coefficients
        expected = float(np.sum((beside @ coefficients) ** 2))
    possible = _possible(plain, columns, general)
    rows_in = _rows_of_a_block(plain)
    blocks = max(1, len(before) // rows_in)
    edges = np.arange(0, blocks * rows_in, rows_in)
    won, most = (np.add.reduceat(each[: blocks * rows_in], edges) for each in (before**2 - after**2, possible))
    draws = generator(seed, "bootstrap of the gain").integers(0, blocks, (DRAWS, blocks))
    bound = max(float(most.sum()), float(won.sum()), 1e-9)
    drawn, possible_drawn = won[draws].sum(axis=1), most[draws].sum(axis=1)
    fractions = drawn / np.maximum(np.maximum(possible_drawn, drawn), 0.1 * bound)
    low, high = np.quantile(fractions, [0.025, 0.975])
    return Gain(
        float(won.sum()) / bound,
        (float(low), float(high)),
        float(np.sqrt(np.mean(before**2))),
        float(np.sqrt(np.mean(after**2))),
        ", ".join(recording.table.name for recording in plain.recordings),
        float(np.sum(before**2 - after**2)),
        expected,
    )


def _possible(plain: Regression, columns: Sequence[Array], general: General) -> Array:
    """Per row: what could be taken out of the residual, less what noise alone gives to so many columns.

    The effects' columns with coefficients of these data; in an equation where the general features see more than that
    (F test), they take part. Hundreds of features that see nothing would only add their own scatter.
    """
    before = plain.residual
    seen = [plain.whitened(made) for _, _, made in general]
    out = np.zeros_like(before)
    for equation in plain.equations:
        rows = plain.rows[equation]
        residual = before[rows]
        basis = (
            orthonormal(np.hstack([column[rows] for column in columns])) if columns else np.zeros((len(residual), 0))
        )
        rest = residual - basis @ (basis.T @ residual)
        white = [each for each in seen if equation in each]
        if white:
            shadow = np.hstack([plain.shadow(each) for each in white])
            more = np.hstack([each[equation] for each in white]) - plain.z[rows] @ shadow
            further = orthonormal(more - basis @ (basis.T @ more))
            left = rest - further @ (further.T @ rest)
            freedom, free_rows = further.shape[1], len(residual) - basis.shape[1] - further.shape[1]
            if freedom and free_rows > 0:
                ratio = (float(rest @ rest - left @ left) / freedom) / max(float(left @ left) / free_rows, 1e-300)
                if stats.f.sf(ratio / _memory(plain, left), freedom, free_rows) < MORE:
                    basis, rest = np.hstack([basis, further]), left
        count = min(basis.shape[1] * _memory(plain, rest), 0.5 * len(residual))
        out[rows] = residual**2 - rest**2 * (1.0 + count / max(1, len(residual) - count))
    return out


def _rows_of_a_block(plain: Regression) -> int:
    long = max(round(LONG_BLOCK_S / (each.table.step_s * each.every)) for each in plain.recordings)
    wanted = BLOCK if _white(plain) else max(BLOCK, long)
    return max(1, min(wanted, len(plain.residual) // FEWEST_BLOCKS))


def _white(plain: Regression) -> bool:
    return all(recording.whitened for recording in plain.recordings)


def _memory(plain: Regression, left: Array) -> float:
    """How many times a column counts in what slow columns take out of noise that was not whitened."""
    square = float(np.mean(left**2)) if len(left) > 1 else 0.0
    if _white(plain) or square == 0.0:
        return 1.0
    rho = min(max(float(np.mean(left[1:] * left[:-1])) / square, 0.0), 0.95)
    return (1.0 + rho) / (1.0 - rho)
