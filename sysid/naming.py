"""Find the cause of a misfit: forward selection among the effects of a machine, with honest thresholds.

Every effect is tried at every shape of its grid. An accepted effect must exceed chance among all trials, pay
for its parameters (Bayesian information criterion), and be possible for a machine; effects that explain the data as
well are reported as ties.
"""

import dataclasses
import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import stats

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Columns, Effect
from ranger_sim.sysid.regression import Regression, explained

LEVEL = 0.01  # of the whole selection, shared among all trials
PAYS = 10.0  # gain of the information criterion that an effect must reach
TIE = 6.0  # effects within this of the best are ties
EITHER_SIGN = 2.0  # standard errors of 0 within which a coefficient may have either sign
MOST = 4  # number of accepted effects
NEARLY = 0.1  # of an inflation: another shape's is the same. Chosen by us


@dataclasses.dataclass
class Trial:
    """One effect at one shape, projected off the base: white, shadow as `Regression.product` takes them; gram (k, k);
    product (k,) with the residual; taken (k, m): its coordinates among the effects accepted before it."""

    effect: Effect
    shape: Mapping[str, float]
    white: dict[str, Array]
    shadow: Array
    gram: Array
    product: Array
    inflation: float
    taken: Array


@dataclasses.dataclass
class Named:
    """An accepted effect, at its best shape. p: by chance among all trials; bic: gain; tied: effects that do as
    well."""

    effect: Effect
    shape: Mapping[str, float]
    chi2: float
    freedom: int
    p: float
    bic: float
    tied: list[Effect]
    rivals: list[tuple[Effect, float]]  # all others, and their deficit in the information criterion

    @property
    def coefficients(self) -> tuple[str, ...]:
        """Names of its columns in a regression that has them, different from those of any other effect."""
        return tuple(f"{self.effect.cause}@{self.effect.at}:{name}" for name in self.effect.coefficients)


def trials(
    effects: Sequence[Effect], regression: Regression, shapes: Sequence[Mapping[str, float]] | None = None
) -> list[Trial]:
    """Trials of every effect at every shape, of its own grid or of `shapes`."""
    made = []
    for effect in effects:
        for shape in effect.shapes if shapes is None else shapes:
            columns = [effect.columns(recording, shape, regression.values) for recording in regression.recordings]
            if not any(columns):
                continue
            white = regression.whitened_once((id(effect), tuple(shape.values())), columns)
            if not white:
                continue
            shadow = regression.shadow(white)
            gram = regression.gram(white, shadow)
            if np.sqrt(np.trace(gram)) > 1e-6:
                product = regression.product(white, shadow, regression.residual)
                inflation = regression.inflation(white, shadow, gram)
                nothing = np.zeros((len(product), 0))
                made.append(Trial(effect, shape, white, shadow, gram, product, inflation, nothing))
    return made


def select(effects: Sequence[Effect], regression: Regression, level: float = LEVEL, most: int = MOST) -> list[Named]:
    """The effects that the data support, the most significant first."""
    all_trials = trials(effects, regression)
    taken: list[Named] = []
    count = max(1, len(all_trials))
    size = regression.size
    while len(taken) < most:
        scored = []
        for trial in all_trials:
            if any(each.effect.excludes(trial.effect) for each in taken):
                continue
            chi2, freedom = explained(trial.gram, trial.product)
            chi2 /= trial.inflation
            if freedom:
                shapes = len(trial.effect.shapes)
                # a shape found on a grid counts as a parameter
                free = freedom + (1 if shapes > 1 else 0)
                bic = chi2 - free * math.log(size) - 2.0 * math.log(shapes)
                scored.append((bic, chi2, freedom, trial))
        if not scored:
            break
        best: dict[int, tuple[float, float, int, Trial]] = {}
        for each in scored:
            key = id(each[3].effect)
            if key not in best or each[0] > best[key][0]:
                best[key] = each
        ranking = sorted(best.values(), key=lambda each: -each[0])
        chosen = next((each for each in ranking if possible(each[3])), None)
        if chosen is None:
            break
        bic, chi2, freedom, trial = chosen
        p = min(1.0, float(stats.chi2.sf(chi2, freedom)) * count)
        if p >= level or bic <= PAYS:
            break
        rivals = [(each[3].effect, bic - each[0]) for each in ranking if each[3].effect is not trial.effect]
        tied = [
            each[3].effect
            for each in ranking
            if each[3].effect is not trial.effect and bic - each[0] < TIE and possible(each[3])
        ]
        taken.append(Named(trial.effect, trial.shape, chi2, freedom, p, bic, tied, rivals))
        take(trial, all_trials, regression)
    return taken


def take(chosen: Trial, trials: Sequence[Trial], regression: Regression) -> None:
    """Project every trial off the chosen one as well."""
    beside = regression.full(chosen.white) - regression.z @ chosen.shadow
    values, vectors = np.linalg.eigh(chosen.gram)
    strong = values > 1e-9 * max(float(values[-1]), 1e-300)
    turn = vectors[:, strong] / np.sqrt(values[strong])  # (k, m): to orthonormal columns
    won = turn.T @ chosen.product
    coordinates = chosen.taken
    for trial in trials:
        across = regression.product(trial.white, trial.shadow, beside) - trial.taken @ coordinates.T
        new = across @ turn
        trial.gram = trial.gram - new @ new.T
        trial.product = trial.product - new @ won
        trial.taken = np.hstack([trial.taken, new])


def coefficients(columns: Array, residual: Array) -> Array:
    """Least-squares coefficients of these columns."""
    return np.asarray(np.linalg.lstsq(columns, residual, rcond=1e-9)[0], dtype=float)


def possible(trial: Trial) -> bool:
    """Whether a machine can have these values. A sign within the noise may be the possible one."""
    found = np.linalg.lstsq(trial.gram, trial.product, rcond=1e-12)[0]
    errors = np.sqrt(np.diag(np.linalg.pinv(trial.gram, rcond=1e-12)))
    choices = [
        (float(value),) if abs(value) > EITHER_SIGN * error else (float(value), 2.0 * error, -2.0 * error)
        for value, error in zip(found, errors, strict=True)
    ]
    return any(
        trial.effect.admissible({**dict(zip(trial.effect.coefficients, each, strict=True)), **trial.shape})
        for each in itertools.product(*choices)
    )


def by_shapes(gains: Sequence[float], inflations: Sequence[float]) -> list[float]:
    """Chi-squares of one effect at several shapes; inflations near that of the best shape count as the same one.

    It is a little larger or smaller at each shape, and of a large effect a hundred-thousandth is more than the
    difference between two shapes.
    """
    best = int(np.argmax([gain / each for gain, each in zip(gains, inflations, strict=True)]))
    same = inflations[best]
    return [
        gain / (same if abs(each - same) < NEARLY * same else each)
        for gain, each in zip(gains, inflations, strict=True)
    ]


def inexact(trial: Trial) -> float:
    """What an exact effect loses of its gain (a chi-square times its inflation) where its coefficient is the shape.

    The smallest shape of its grid is one of first order.
    """
    effect = trial.effect
    if effect.equals is None:
        return 0.0
    size, shape = float(trial.gram[0, 0]), trial.shape[effect.equals]
    value = float(trial.product[0]) / max(size, 1e-300)
    if shape <= min(each[effect.equals] for each in effect.shapes) and value < shape:
        return 0.0
    return (value - shape) ** 2 * size


def refit(
    regression: Regression,
    named: Sequence[Named],
    together: Sequence[Named] | None = None,
    values: Mapping[str, float] | None = None,
    fresh: bool = False,
) -> Regression:
    """The regression with these effects in its base; its noise stays the same, or is estimated again when `fresh`.

    together: the base's whole set of effects, when the regression already has some of it. values: the machine's
    parameters with which the effects' columns are made, those of the regression when None.
    """
    chosen = list(named if together is None else together)
    if not chosen:
        return regression
    at = values if values is not None else regression.values
    names = [name for each in chosen for name in each.coefficients]
    extra: list[Columns] = []
    for recording in regression.recordings:
        made = [(each.effect.columns(recording, each.shape, at), len(each.effect.coefficients)) for each in chosen]
        rows = len(recording.table)
        extra.append(
            {
                equation: np.hstack([part.get(equation, np.zeros((rows, width))) for part, width in made])
                for equation in recording.equations
            }
        )
    out = Regression(regression.recordings, extra, names, noise=None if fresh else regression)
    if not fresh:
        out.kept = regression.kept  # whitened by the same noise
    return out
