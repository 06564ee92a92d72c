"""Parameters fitted to data, with intervals; refused rather than wrong.

    Parameter        one unknown: start, limits, source of the limits; prior knowledge of it
    fit              least squares between two checks: before it, that every parameter moves the residual;
                     after it, that no parameter is on a limit and that the values are possible
    Identifiability  the parameters that these data can separate, known before the fit
    Fit              values with standard errors and 95 % intervals, or the reason for their absence

A residual is a function of a dict {name: value} that returns measured minus simulated, shape (n,). Its rows should have
the same noise: divide each channel by its own.

Intervals count the samples that are independent, not all of them. With the correlation rho of neighbours in the
residual, n samples of an AR(1) are worth n (1 - rho) / (1 + rho) (Bayley and Hammersley 1946, The effective number of
independent observations in an autocorrelated time series). That is exact for a mean, and the common rule for the rest.
"""

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

from ranger_sim.foundation.user_error import UserError

Array = NDArray[np.float64]
Residual = Callable[[dict[str, float]], Array]

NOT_SEPARABLE = 0.95  # |cos| of two orthogonalised signatures from which on these data do not separate them
PROFILE_LIMIT = 3.84  # of twice the log-likelihood's fall: 95 % of chi-square with one degree of freedom
# A residual that changes by less than this part of its size has not moved: rounding. Chosen by us.
STILL = 1e-12
# This near to a limit, in standard errors, a value is on it: a free one is as near once in a thousand fits.
ON_A_LIMIT = 1e-3
ROUNDS = 8  # of fit and noise estimate, where prior knowledge is weighed against data of unknown noise
STEADY = 1e-3  # relative change of the noise below which the rounds end


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One unknown. value: start; low, high: limits; source: of start and limits.

    uncertainty: standard deviation with which `value` is known before the data (an instrument's offset from its data
    sheet, a length from a tape measure); 0: no prior knowledge. scale: a change of it that matters; 0: |value|, or a
    tenth of the range where the value is 0.
    """

    name: str
    unit: str
    value: float
    low: float = -math.inf
    high: float = math.inf
    source: str = ""
    uncertainty: float = 0.0
    scale: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.value) or not self.low < self.value < self.high:
            raise UserError(
                f"parameter {self.name}: start {self.value!r} {self.unit} is not between its limits "
                f"{self.low:g} and {self.high:g}"
            )
        if self.uncertainty < 0.0 or self.scale < 0.0:
            raise UserError(f"parameter {self.name}: uncertainty and scale must not be negative")

    @property
    def step(self) -> float:
        """The change that counts as one in the fit's own variables."""
        if self.scale > 0.0:
            return self.scale
        if self.uncertainty > 0.0:
            return self.uncertainty
        if self.value != 0.0:
            return abs(self.value)
        width = self.high - self.low
        return 0.1 * width if math.isfinite(width) else 1.0


@dataclasses.dataclass(frozen=True)
class Identifiability:
    """Parameters that the data can separate, without prior knowledge.

    singular_values: of the residual's derivatives, each parameter in its `step`, falling; weakest: the direction of the
    last of them, by name; sensitivity: root mean square of the residual's change per `step` of a parameter; cosines:
    of each pair's signatures, after projecting out all others, shape (p, p).
    """

    names: tuple[str, ...]
    singular_values: Array
    weakest: dict[str, float]
    sensitivity: dict[str, float]
    cosines: Array

    @property
    def condition(self) -> float:
        """Largest over smallest singular value; infinite where a combination has no effect at all."""
        last = float(self.singular_values[-1])
        return float(self.singular_values[0]) / last if last > 0.0 else math.inf

    @property
    def ties(self) -> list[tuple[str, str, float]]:
        """Pairs that these data do not separate, with |cos|, the worst first."""
        found = [
            (self.names[i], self.names[j], float(self.cosines[i, j]))
            for i in range(len(self.names))
            for j in range(i)
            if self.cosines[i, j] > NOT_SEPARABLE
        ]
        return sorted(found, key=lambda tie: -tie[2])

    def lines(self) -> list[str]:
        """Text for a person."""
        values = "  ".join(f"{value:.3g}" for value in self.singular_values)
        told = [f"singular values  {values}  (condition {self.condition:.3g})"]
        told += [
            f"{first} and {second} are not separable by these data (|cos| {cosine:.3f})"
            for first, second, cosine in self.ties
        ]
        return told


@dataclasses.dataclass(frozen=True)
class Fit:
    """Result of a fit. With `refused` it is unusable: `values`, `standard_errors` and `ci95` are empty,
    and `ended_at` has the values at the end.

    residual: at the end, shape (n,); rho: correlation of its neighbours; effective_samples: of n;
    noise: standard deviation of one row, estimated (or as given); covariance: shape (p, p), in order of `names`.
    """

    names: tuple[str, ...]
    units: dict[str, str]
    values: dict[str, float]
    standard_errors: dict[str, float]
    ci95: dict[str, tuple[float, float]]
    covariance: Array
    residual: Array
    residual_rms: float
    noise: float
    rho: float
    effective_samples: float
    identifiability: Identifiability
    ended_at: dict[str, float]
    refused: str = ""
    objective: "_Objective | None" = dataclasses.field(default=None, repr=False, compare=False)

    def __getitem__(self, name: str) -> float:
        if self.refused:
            raise UserError(f"the fit was refused: {self.refused}; it has no value of {name}")
        try:
            return self.values[name]
        except KeyError:
            raise UserError(f"the fit has no parameter {name}; it has {', '.join(self.names)}") from None

    @property
    def sensitivity(self) -> dict[str, float]:
        """Root mean square of the residual's change per `step` of each parameter, at the start."""
        return self.identifiability.sensitivity

    @property
    def correlations(self) -> Array:
        """Of the estimates, shape (p, p)."""
        errors = np.sqrt(np.diag(self.covariance))
        return self.covariance / np.outer(errors, errors)

    def covers(self, name: str, truth: float) -> bool:
        """Whether the 95 % interval of `name` contains `truth`."""
        low, high = self.ci95[name]
        return low <= truth <= high

    def profile(self, name: str, width: float = 3.0, count: int = 13) -> tuple[Array, Array]:
        """Values of `name` within `width` standard errors and its limits, and their cost with all others refitted.

        The cost is twice the fall of the log-likelihood: PROFILE_LIMIT of it bounds the 95 % interval.
        """
        cost, low, high = self._profile_of(name, width)
        tried = np.linspace(low, high, count)
        return tried, np.array([cost(float(value)) for value in tried])

    def profile_interval(self, name: str, width: float = 10.0) -> tuple[float, float]:
        """Points where the profile of `name` crosses PROFILE_LIMIT; infinite on a side without one within `width`."""
        cost, low, high = self._profile_of(name, width)
        best = self.values[name]
        ends = [
            float(optimize.brentq(lambda value: cost(value) - PROFILE_LIMIT, best, end, rtol=1e-6))
            if cost(end) > PROFILE_LIMIT
            else math.copysign(math.inf, end - best)
            for end in (low, high)
        ]
        return ends[0], ends[1]

    def _profile_of(self, name: str, width: float) -> tuple[Callable[[float], float], float, float]:
        """Function of the cost of a value of `name`, and the ends of its range."""
        best = np.array([self[each] for each in self.names])
        assert self.objective is not None
        objective, at = self.objective, self.names.index(name)
        least = objective.cost(best)
        far = width * self.standard_errors[name]
        return (
            lambda value: objective.solve(best, fixed=(at, value))[1] - least,
            max(float(objective.low[at]), best[at] - far),
            min(float(objective.high[at]), best[at] + far),
        )

    def lines(self) -> list[str]:
        """Text for a person: one line for each parameter, or the reason for their absence."""
        if self.refused:
            return [f"refused: {self.refused}"]
        told = []
        for name in self.names:
            low, high = self.ci95[name]
            told.append(f"{name:28}{self.values[name]:12.6g}  [{low:.6g}, {high:.6g}] {self.units[name]}")
        worth = f"{len(self.residual)} samples worth {self.effective_samples:.0f} (rho {self.rho:.2f})"
        return [*told, f"residual {self.residual_rms:.4g} rms, {worth}"]


def neighbours_correlation(residual: Array, runs: Sequence[slice] = ()) -> float:
    """rho of an AR(1): correlation of neighbours, pairs across the ends of `runs` left out."""
    parts = [residual[run] for run in runs] or [residual]
    centred = [part - residual.mean() for part in parts]
    square = sum(float(part @ part) for part in centred)
    if square <= 0.0:
        return 0.0
    return sum(float(part[1:] @ part[:-1]) for part in centred) / square


def independent_samples(count: int, rho: float) -> float:
    """Number of independent samples that `count` samples of an AR(1) are worth; at most `count`, even for rho < 0."""
    inside = min(max(rho, 0.0), 1.0 - 1e-9)
    return count * (1.0 - inside) / (1.0 + inside)


def identifiability(
    residual: Residual, parameters: Sequence[Parameter], derivative_step: float = 1e-5
) -> Identifiability:
    """Identifiability from the residual's derivatives at the start. UserError names parameters that do not move it."""
    unknown = _Objective(residual, parameters, (), derivative_step)
    return _identifiability(unknown, unknown.start, unknown.evaluate(unknown.start))


def fit(
    residual: Residual,
    parameters: Sequence[Parameter],
    effective_samples: float | None = None,
    *,
    runs: Sequence[slice] = (),
    noise: float | None = None,
    earlier: Iterable[Fit] = (),
    physical: Callable[[dict[str, float]], str | None] | None = None,
    derivative_step: float = 1e-5,
    tell: Callable[[str], None] | None = None,
) -> Fit:
    """Fit by least squares.

    effective_samples: number of independent rows; None: from the residual's correlation, within `runs`. noise: standard
    deviation of a row where it is known; None: estimated from the residual. earlier: fits of other data; their results
    for parameters of the same names are weighed in, with their covariance. physical: returns why these values are
    impossible, in words, or None. `tell` receives the lines of the identifiability before the fit begins.
    derivative_step: of the central differences, in each parameter's `step`.

    UserError: a parameter does not move the residual, values are not finite, names are repeated, rows are too few.
    """
    names = tuple(parameter.name for parameter in parameters)
    unknown = _Objective(residual, parameters, earlier, derivative_step)
    at_start = unknown.evaluate(unknown.start)
    count = len(at_start)
    before = _identifiability(unknown, unknown.start, at_start)
    if tell is not None:
        for line in before.lines():
            tell(line)
    free = len(names) - unknown.rank
    if count <= free:
        raise UserError(f"{count} rows of data are too few for {free} parameters of which nothing is known")

    best, at_best, converged = unknown.start, at_start, ""
    sigma = noise if noise is not None else float(np.sqrt(np.mean(at_start**2)))
    samples, rho, used = float(count), 0.0, float(free)
    for _ in range(ROUNDS):
        unknown.weigh(sigma, samples / count)
        best, _, converged = unknown.solve(best)
        at_best = unknown.evaluate(best)
        rho = neighbours_correlation(at_best, runs)
        samples = effective_samples if effective_samples is not None else independent_samples(count, rho)
        derivatives = unknown.derivatives(best)
        unknown.weigh(sigma, samples / count)
        used = unknown.parameters_used(derivatives)
        last = sigma
        if noise is None:
            sigma = float(np.sqrt(at_best @ at_best / max(count - used, 1.0)))
        if unknown.rank == 0 or abs(sigma - last) <= STEADY * last:
            break  # without prior knowledge, the weight does not move the best values
    unknown.weigh(sigma, samples / count)
    covariance, singular = unknown.covariance(unknown.derivatives(best))
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    ended_at = dict(zip(names, best.tolist(), strict=True))

    refused = converged
    if singular:
        refused = f"these data do not determine {singular}"
    else:
        refused = refused or _limits_met(parameters, best, errors) or _impossible(physical, ended_at)
    if not refused and samples - used < 1.0:
        refused = f"{count} samples are worth {samples:.1f}, too few for {used:.0f} parameters"
    spread = float(stats.norm.ppf(0.975) if noise is not None else stats.t.ppf(0.975, max(samples - used, 1.0)))
    return Fit(
        names=names,
        units={parameter.name: parameter.unit for parameter in parameters},
        values={} if refused else ended_at,
        standard_errors={} if refused else dict(zip(names, errors.tolist(), strict=True)),
        ci95={}
        if refused
        else {
            name: (float(value - spread * error), float(value + spread * error))
            for name, value, error in zip(names, best, errors, strict=True)
        },
        covariance=covariance,
        residual=at_best,
        residual_rms=float(np.sqrt(np.mean(at_best**2))),
        noise=sigma,
        rho=rho,
        effective_samples=float(samples),
        identifiability=before,
        ended_at=ended_at,
        refused=refused,
        objective=unknown,
    )


class _Objective:
    """The residual as a function of a vector, with the prior knowledge as further rows.

    precision: of the prior knowledge, shape (p, p), about `centre`; its `rank` is 0 where there is none.
    """

    def __init__(
        self, residual: Residual, parameters: Sequence[Parameter], earlier: Iterable[Fit], derivative_step: float
    ) -> None:
        self.names = [parameter.name for parameter in parameters]
        twice = sorted({name for name in self.names if self.names.count(name) > 1})
        if twice or not parameters:
            raise UserError(f"parameter {', '.join(twice)}: named twice" if twice else "no parameter to fit")
        self.residual = residual
        self.start = np.array([parameter.value for parameter in parameters])
        self.low = np.array([parameter.low for parameter in parameters])
        self.high = np.array([parameter.high for parameter in parameters])
        self.step = np.array([parameter.step for parameter in parameters])
        self.derivative_step = derivative_step
        known = np.array([parameter.uncertainty for parameter in parameters])
        self.precision = np.diag(np.where(known > 0.0, 1.0 / np.where(known > 0.0, known, 1.0) ** 2, 0.0))
        pull = self.precision @ self.start
        for other in earlier:
            pull += self._know(other)
        squares, axes = np.linalg.eigh(self.precision * np.outer(self.step, self.step))
        kept = squares > 1e-12 * max(float(squares[-1]), 1e-300)
        self.rank = int(np.count_nonzero(kept))
        self.root = (axes[:, kept] * np.sqrt(squares[kept])).T / self.step  # root^T root = precision
        inverse = np.where(kept, 1.0 / np.where(kept, squares, 1.0), 0.0)
        self.centre = self.step * ((axes * inverse) @ axes.T @ (self.step * pull)) if self.rank else self.start
        self.weight = 1.0

    def _know(self, other: Fit) -> Array:
        """Add another fit's results for our parameters to the precision; returns its pull."""
        pull = np.zeros(len(self.names))
        shared = [name for name in other.names if name in self.names]
        if not shared:
            return pull
        if other.refused:
            raise UserError(f"an earlier fit was refused: {other.refused}; nothing can be taken from it")
        mine = [self.names.index(name) for name in shared]
        theirs = [other.names.index(name) for name in shared]
        scale = np.outer(errors := np.sqrt(np.diag(other.covariance))[theirs], errors)
        inverse = np.linalg.inv(other.covariance[np.ix_(theirs, theirs)] / scale) / scale
        found = np.array([other.values[name] for name in shared])
        self.precision[np.ix_(mine, mine)] += inverse
        pull[mine] = inverse @ found
        self.start[mine] = np.clip(found, np.nextafter(self.low[mine], np.inf), np.nextafter(self.high[mine], -np.inf))
        return pull

    def weigh(self, sigma: float, share: float) -> None:
        """Weight rows of data with 1 / sigma^2 times `share`, the part of them that is independent."""
        self.weight = math.sqrt(share) / sigma if sigma > 0.0 else 1.0 / STILL

    def evaluate(self, values: Array) -> Array:
        """The residual, shape (n,). UserError where it is not finite."""
        made = np.asarray(self.residual(dict(zip(self.names, values.tolist(), strict=True))), dtype=np.float64)
        if made.ndim != 1:
            raise UserError(f"the residual has shape {made.shape}, one row of numbers is needed")
        if not np.all(np.isfinite(made)):
            at = ", ".join(f"{name} {value:.6g}" for name, value in zip(self.names, values, strict=True))
            raise UserError(f"the residual is not finite in {np.count_nonzero(~np.isfinite(made))} rows at {at}")
        return made

    def derivatives(self, values: Array, step: float | None = None) -> Array:
        """d residual / d parameter, shape (n, p), by central differences inside the limits."""
        columns = []
        for at in range(len(values)):
            size = (step or self.derivative_step) * self.step[at]
            above, below = values.copy(), values.copy()
            above[at] = min(values[at] + size, self.high[at])
            below[at] = max(values[at] - size, self.low[at])
            columns.append((self.evaluate(above) - self.evaluate(below)) / (above[at] - below[at]))
        return np.column_stack(columns)

    def rows(self, values: Array) -> Array:
        """Weighted residual, and distances of the values from the prior."""
        data = self.weight * self.evaluate(values)
        return np.concatenate([data, self.root @ (values - self.centre)]) if self.rank else data

    def cost(self, values: Array) -> float:
        """Sum of squares: twice the negative log-likelihood."""
        rows = self.rows(values)
        return float(rows @ rows)

    def solve(self, start: Array, fixed: tuple[int, float] | None = None) -> tuple[Array, float, str]:
        """Best values, their cost, and why they are not good ("" where they are). fixed: (place, value) kept."""
        moving = [at for at in range(len(start)) if fixed is None or at != fixed[0]]
        whole = start.copy()
        if fixed is not None:
            whole[fixed[0]] = fixed[1]
        if not moving:
            return whole, self.cost(whole), ""

        def values(scaled: Array) -> Array:
            made = whole.copy()
            made[moving] = scaled * self.step[moving]
            return made

        def slope(scaled: Array) -> Array:
            derivatives = self.weight * self.derivatives(values(scaled))
            whole_slope = np.vstack([derivatives, self.root]) if self.rank else derivatives
            return whole_slope[:, moving] * self.step[moving]

        found = optimize.least_squares(
            lambda scaled: self.rows(values(scaled)),
            whole[moving] / self.step[moving],
            jac=slope,
            bounds=(self.low[moving] / self.step[moving], self.high[moving] / self.step[moving]),
            x_scale="jac",
            xtol=1e-11,
            ftol=1e-13,
            gtol=1e-12,
            max_nfev=200,
        )
        return values(found.x), 2.0 * float(found.cost), "" if found.status > 0 else "no end within 200 iterations"

    def parameters_used(self, derivatives: Array) -> float:
        """Number of parameters that the data (and not the prior) determine: the trace of the fit's hat matrix."""
        scaled = self.weight * derivatives * self.step
        data = scaled.T @ scaled
        known = self.precision * np.outer(self.step, self.step)
        return float(np.trace(np.linalg.pinv(data + known, hermitian=True) @ data))

    def covariance(self, derivatives: Array) -> tuple[Array, str]:
        """Covariance of the estimates, shape (p, p), and the names that nothing determines ("" in the good case)."""
        rows = np.vstack([self.weight * derivatives, self.root])
        lengths = np.linalg.norm(rows, axis=0)
        _, sizes, axes = np.linalg.svd(rows / lengths, full_matrices=False)
        # Central differences of a simulation leave 1e-9 of a column; a direction that weak is their error, not a
        # result.
        good = sizes > 1e-7 * sizes[0]
        inverse = np.where(good, 1.0 / np.where(good, sizes, 1.0), 0.0)
        covariance = (axes.T * inverse**2) @ axes / np.outer(lengths, lengths)
        lost = [name for at, name in enumerate(self.names) if np.max(np.abs(axes[~good, at]), initial=0.0) > 1e-3]
        return covariance, " and ".join(lost)


def _identifiability(unknown: _Objective, start: Array, at_start: Array) -> Identifiability:
    """Derivatives at the start and the identifiability; UserError for parameters that do not move the residual."""
    size = float(np.max(np.abs(at_start), initial=0.0))
    derivatives = unknown.derivatives(start)
    still = np.max(np.abs(derivatives), axis=0) * unknown.step * unknown.derivative_step <= STILL * size
    if np.any(still):  # once more with a step that leaves a dead zone
        derivatives[:, still] = unknown.derivatives(start, 0.1)[:, still]
        still &= np.max(np.abs(derivatives), axis=0) * unknown.step * 0.1 <= STILL * size
    if np.any(still):
        lame = ", ".join(name for name, lies in zip(unknown.names, still, strict=True) if lies)
        raise UserError(f"parameter {lame}: a change of it does not move the residual; is it applied, and excited?")
    scaled = derivatives * unknown.step
    _, sizes, axes = np.linalg.svd(scaled, full_matrices=False)
    return Identifiability(
        names=tuple(unknown.names),
        singular_values=np.concatenate([sizes, np.zeros(len(start) - len(sizes))]),
        weakest=dict(zip(unknown.names, axes[-1].tolist(), strict=True)),
        sensitivity=dict(zip(unknown.names, np.sqrt(np.mean(scaled**2, axis=0)).tolist(), strict=True)),
        cosines=signature_cosines(scaled),
    )


def signature_cosines(signatures: Array) -> Array:
    """|cos| of each pair of columns after projecting all others out of both, shape (p, p)."""
    columns = signatures / np.linalg.norm(signatures, axis=0)
    count = columns.shape[1]
    cosines = np.eye(count)
    for i in range(count):
        for j in range(i):
            others = np.delete(columns, [i, j], axis=1)
            pair = columns[:, [i, j]]
            left = pair - others @ np.linalg.lstsq(others, pair, rcond=1e-10)[0] if others.shape[1] else pair
            lengths = np.linalg.norm(left, axis=0)
            if np.min(lengths) > 1e-9:
                pair = left / lengths
            # Otherwise the others already contain one of the two. That is their tie; the remainder would be rounding,
            # so this pair's cosine uses the two unprojected columns.
            cosines[i, j] = cosines[j, i] = min(abs(float(pair[:, 0] @ pair[:, 1])), 1.0)
    return cosines


def _limits_met(parameters: Sequence[Parameter], values: Array, errors: Array) -> str:
    """The values that are on a limit, in words; "" when none is."""
    met = []
    for parameter, value, error in zip(parameters, values, errors, strict=True):
        near = max(ON_A_LIMIT * error, 1e-6 * parameter.step)
        for side, limit in (("lower", parameter.low), ("upper", parameter.high)):
            if abs(value - limit) <= near:
                met.append(f"{parameter.name} is at its {side} limit {limit:g} {parameter.unit}")
    return "; ".join(met)


def _impossible(physical: Callable[[dict[str, float]], str | None] | None, values: Mapping[str, float]) -> str:
    """The reason why the values are physically impossible, in words."""
    return (physical(dict(values)) or "") if physical is not None else ""
