"""Fit of the hypothesis "these candidates are wrong, and the others are as known" to the figures.

Under a hypothesis its candidates are free within their limits. Every other candidate has the error with which it is
known, and the figures' covariance includes that error (generalised least squares): with f the simulated figures at z
and J their slopes over the others, each in its own step,

    r = y - f,   D = diag(sd^2 + model_sd^2 + variance of f),   V = D + J P J'
    deviance = r' V^-1 r + ln det D - 2 ln (chance of the endurance)

P is diagonal, (known_sd / step)^2. The others' own estimate is P J' V^-1 r. A grid search covers the free ones, so the
result depends on no start, and the profile of the deviance on the same grid gives their interval: 3.84 above the
least for 95 %.

Endurance. From F failures in S units survived around a point the chance of another N units is
(S / (S + N))^(F + 1/2): a constant hazard without prior knowledge (Jeffreys' prior), integrated out. Points nearer
than about half a step count, and everywhere `unseen` units without a failure are added, so that there is no evidence
where nothing was simulated.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import stats

from studies.figures.question import Candidate, Figure
from studies.figures.surface import Array, Surface

PROFILE_LIMIT = 3.84  # above the least deviance: 95 % of a chi-square with one degree of freedom
GRID = {0: 1, 1: 61, 2: 15}  # values of each free candidate on the first grid and on each finer one; chosen by us
REFINED = 2  # times that the grid is refined about its remaining part
WINDOW = 14.0  # above the least deviance: reach of the refined grid, beyond the 3.84 and the 6 of a tie
NEAR = 0.5  # steps: standard deviation of the weight of another point's runs for the endurance here
LINEARISED = 2  # rounds of moving the others to their estimates and taking their slopes there
FARTHEST = 4.0  # of its own known_sd, the largest move of an other candidate: beyond, it should be a hypothesis itself


@dataclasses.dataclass
class Evidence:
    """All simulations so far, in the form that the hypotheses need.

    places: (n, p) in steps; survived, failures: (n,) summed over a place's runs.
    """

    surfaces: Mapping[str, Surface]
    places: Array
    survived: Array
    failures: Array
    unseen: float

    def log_endurance(self, asked: Array, figure: Figure) -> Array:
        """Log-likelihood of the endurance at `asked`, (m, p) -> (m,)."""
        distance = ((asked[:, None, :] - self.places[None, :, :]) ** 2).sum(axis=2)
        weight = np.exp(-0.5 * distance / NEAR**2)
        seen = self.unseen + weight @ self.survived
        power = 0.5 + weight @ self.failures
        log = power * (np.log(seen) - np.log(seen + figure.value))
        if not figure.at_least:  # it failed there: the density instead of the chance to get this far
            log += np.log(power) - np.log(seen + figure.value)
        return log


@dataclasses.dataclass(frozen=True)
class Hypothesis:
    """One hypothesis at its best. place: (p,) in steps, of all candidates; sd: (p,), of the others' estimates.

    deviance, bic: comparable between hypotheses of the same evidence; misfit: r' V^-1 r, a chi-square of about
    `freedom` degrees if the hypothesis is true. intervals: of the free candidates, in steps; None at an end that the
    limits set. residual, error: (figures,), measured less simulated at `place`, and its standard deviation.
    """

    free: tuple[str, ...]
    place: Array
    sd: Array
    deviance: float
    bic: float
    misfit: float
    freedom: int
    intervals: Mapping[str, tuple[float | None, float | None]]
    residual: Array
    error: Array
    profiles: Mapping[str, tuple[Array, Array]]  # values in steps, deviance above the least

    @property
    def p(self) -> float:
        """Chance of a larger misfit if the hypothesis is true; meaningless with as many free candidates as figures."""
        return float(stats.chi2.sf(self.misfit, self.freedom)) if self.freedom > 0 else 1.0


class Judge:
    """Weighs hypotheses against figures. candidates in the order of the columns of `Evidence.places`."""

    def __init__(self, candidates: Sequence[Candidate], gait: Sequence[Figure], endurance: Figure | None) -> None:
        self.candidates = list(candidates)
        self.names = [each.name for each in candidates]
        self.gait = list(gait)
        self.endurance = endurance
        self.measured = np.array([each.value for each in gait])
        self.variance = np.array([each.error**2 for each in gait])
        self.low = np.array([(each.low - each.value) / each.step for each in candidates])
        self.high = np.array([(each.high - each.value) / each.step for each in candidates])
        self.known = np.array([each.known_sd / each.step for each in candidates])

    @property
    def count(self) -> int:
        """Figures, an endurance among them."""
        return len(self.gait) + (self.endurance is not None)

    def simulated(self, evidence: Evidence, places: Array) -> tuple[Array, Array]:
        """Mean and variance of every figure at `places`, (m, p) -> (m, figures) each."""
        found = [evidence.surfaces[each.name](places) for each in self.gait]
        return np.stack([mean for mean, _ in found], axis=1), np.stack([variance for _, variance in found], axis=1)

    def slopes(self, evidence: Evidence, places: Array, columns: Sequence[int]) -> Array:
        """Slopes of the figures over the candidates of `columns`, per step: (m, figures, len(columns))."""
        slopes = [evidence.surfaces[each.name].slopes(places)[:, columns] for each in self.gait]
        return np.stack(slopes, axis=1)

    def weigh(self, evidence: Evidence, free: tuple[str, ...], refined: int = REFINED) -> Hypothesis:
        """The hypothesis that the candidates `free` are wrong, at its best; `refined` 0: a first, coarse search."""
        at = [self.names.index(name) for name in free]
        ends = [(self.low[each], self.high[each]) for each in at]
        axes = _axes(ends, GRID[len(at)])
        found = self._on(evidence, at, axes)
        for _ in range(refined if at else 0):
            axes = [self._window(found[0], axes, number, ends[number]) for number in range(len(at))]
            found = self._on(evidence, at, axes)
        deviance, places, sds, misfits, residuals, errors = found
        shape = tuple(len(axis) for axis in axes)
        best = int(np.argmin(deviance))
        least = float(deviance[best])
        cube = deviance.reshape(shape) - least
        intervals, profiles = {}, {}
        for number, name in enumerate(free):
            others = tuple(each for each in range(len(at)) if each != number)
            profile = cube.min(axis=others)
            profiles[name] = (axes[number], profile)
            intervals[name] = _interval(axes[number], profile, ends[number])
        return Hypothesis(
            free,
            places[best],
            sds[best],
            least,
            least + len(free) * float(np.log(self.count)),
            float(misfits[best]),
            len(self.gait) - len(free),
            intervals,
            residuals[best],
            errors[best],
            profiles,
        )

    def _on(self, evidence: Evidence, at: list[int], axes: list[Array]) -> tuple[Array, ...]:
        """On the grid of `axes`: deviance (m,), places (m, p), the others' sd (m, p), misfit (m,), residual and error
        (m, figures).
        """
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(at)) if at else np.zeros((1, 0))
        count, others = len(grid), [each for each in range(len(self.names)) if each not in at]
        places = np.zeros((count, len(self.names)))
        places[:, at] = grid
        reach = FARTHEST * self.known[others]
        low, high = np.maximum(self.low[others], -reach), np.minimum(self.high[others], reach)
        prior = np.tile(self.known[others] ** 2, (count, 1))
        centre = np.zeros_like(prior)  # of the prior; an estimate that meets a limit stays on it, without error
        for turn in range(LINEARISED):
            mean, variance = self.simulated(evidence, places)
            slopes = self.slopes(evidence, places, others)
            residual = self.measured - mean + np.einsum("mfo,mo->mf", slopes, places[:, others] - centre)
            whole = np.einsum("mfo,mo,mgo->mfg", slopes, prior, slopes)
            whole += np.einsum("mf,fg->mfg", self.variance + variance, np.eye(len(self.gait)))
            solved = np.linalg.solve(whole, residual[:, :, None])[:, :, 0]
            estimate = centre + prior * np.einsum("mfo,mf->mo", slopes, solved)
            places[:, others] = np.clip(estimate, low, high)
            if turn < LINEARISED - 1:
                beyond = places[:, others] != estimate
                centre = np.where(beyond, places[:, others], 0.0)
                prior = np.where(beyond, 0.0, prior)
        misfit = np.einsum("mf,mf->m", residual, solved)
        misfit = misfit + ((centre / self.known[others]) ** 2).sum(axis=1)
        deviance = misfit + np.log(self.variance + variance).sum(axis=1)
        if self.endurance is not None:
            deviance = deviance - 2.0 * evidence.log_endurance(places, self.endurance)
        spread = np.linalg.solve(whole, slopes) if others else slopes
        sds = np.zeros_like(places)
        told = np.einsum("mfo,mfo->mo", slopes, spread)
        known = self.known[others] ** 2
        # a value on a limit has no part in V, so that this adds its own share
        left = np.where(prior > 0.0, prior - prior**2 * told, known / (1.0 + known * told))
        sds[:, others] = np.sqrt(np.maximum(left, 0.0))
        mean, variance = self.simulated(evidence, places)
        return deviance, places, sds, misfit, self.measured - mean, np.sqrt(self.variance + variance)

    def _window(self, deviance: Array, axes: list[Array], number: int, ends: tuple[float, float]) -> Array:
        """The part of an axis within WINDOW of the least deviance, one value of the first grid wider, as fine again."""
        cube = deviance.reshape(tuple(len(axis) for axis in axes))
        profile = cube.min(axis=tuple(each for each in range(len(axes)) if each != number))
        axis = axes[number]
        inside = np.flatnonzero(profile - profile.min() <= WINDOW)
        first, last = max(int(inside[0]) - 1, 0), min(int(inside[-1]) + 1, len(axis) - 1)
        return np.linspace(max(axis[first], ends[0]), min(axis[last], ends[1]), len(axis))


def _axes(ends: Sequence[tuple[float, float]], count: int) -> list[Array]:
    """Even values between each pair of ends, and 0, which is the unchanged simulation."""
    return [np.union1d(np.linspace(low, high, count), [min(max(0.0, low), high)]) for low, high in ends]


def _interval(axis: Array, profile: Array, ends: tuple[float, float]) -> tuple[float | None, float | None]:
    """First crossing of PROFILE_LIMIT on either side of the profile's least; None where the limit is nearer."""
    best = int(np.argmin(profile))
    found: list[float | None] = []
    for step in (-1, 1):
        at = best
        while 0 <= at + step < len(axis) and profile[at + step] < PROFILE_LIMIT:
            at += step
        if not 0 <= at + step < len(axis):
            found.append(None if abs(axis[at] - ends[(step + 1) // 2]) < 1e-9 else float(axis[at]))
            continue
        share = (PROFILE_LIMIT - profile[at]) / (profile[at + step] - profile[at])
        found.append(float(axis[at] + share * (axis[at + step] - axis[at])))
    return found[0], found[1]
