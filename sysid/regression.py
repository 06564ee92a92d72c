"""Several linear balances over several recordings as one regression with white noise of deviation 1.

Each equation has its own noise: an autoregression of its residual whitens it, a deviation scales it; two equations
that share a noisy channel have correlated residuals, and the regression removes that correlation row by row. The result
is ordinary least squares, so that a sum of squares is a chi-square and a difference of two of them tests a hypothesis.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import linalg, sparse, stats

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Columns, Equation, Recording

LEAST = 1e-9  # of the largest response: noise below it is rounding
RANK = 1e-8  # a parameter is not separable if the other columns explain its column up to this part
NOTHING = 1e-9  # of a column's square after the base is projected out: rounding, with columns of up to 1e7 deviations
REACH = 4.0  # widths of the Gaussian
HALF = 0.5  # of its weight: a kept row with less of it on rows that count does not count itself
ORDER = 8  # largest order of the autoregression
MEMORIES = tuple(0.02 * n for n in range(48))  # memories of noise from sample to sample that the fit tries
ONE_SIDED = 2.71  # of -2 log likelihood: 95 % on one side
FEWEST_SHARED = 40  # common rows of two equations for their correlation, which is then known to 0.16
UPPER = 0.95  # noise from repeats is the upper limit of this one-sided interval: few repeats, less trust
FEWEST_REPEATS = 20  # degrees of freedom of pure error; below it the whole residual gives the noise


def reduced(recording: Recording, column: Array, equation: str) -> Array:
    """An equation's column (n,) or (n, k) under the recording's Gaussian, at every `every`-th row.

    Rows that do not count have no weight: a mean of rows at which the equation holds is one at which it holds.
    """
    if recording.width <= 0.0:
        return column[_rows(recording)]
    return np.asarray(_averages(recording, equation)[0] @ column)


def _averages(recording: Recording, equation: str) -> tuple[sparse.csr_array, np.ndarray]:
    """(weights of the rows in each kept row, share of the Gaussian that is on rows that count: 0 at a run's end)."""
    key = equation, recording.width, recording.every
    if key not in recording.averages:
        recording.averages[key] = _weights(recording, equation)
    found: tuple[sparse.csr_array, np.ndarray] = recording.averages[key]
    return found


def _weights(recording: Recording, equation: str) -> tuple[sparse.csr_array, np.ndarray]:
    """As `_averages`, made anew."""
    made = recording.equations.get(equation)
    counts = np.ones(len(recording.table), dtype=bool) if made is None else made.valid
    reach = int(np.ceil(REACH * recording.width))
    near = np.arange(-reach, reach + 1)
    bell = np.exp(-0.5 * (near / recording.width) ** 2)
    bell /= bell.sum()
    rows = _rows(recording)
    starts, stops = (
        np.concatenate([np.full(len(range(run.start, run.stop, recording.every)), each) for run, each in ends])
        for ends in (
            [(run, run.start) for run in recording.table.runs],
            [(run, run.stop) for run in recording.table.runs],
        )
    )
    place = rows[:, None] + near
    inside = (place >= starts[:, None]) & (place < stops[:, None])
    place = np.where(inside, place, rows[:, None])
    weight = bell * inside
    counted = weight * counts[place]
    share = counted.sum(axis=1)
    whole = np.all(inside, axis=1)  # a machine's derivatives are one-sided at the ends of a run
    weight = np.where(share[:, None] > 0.0, counted, weight)
    weight /= weight.sum(axis=1, keepdims=True)
    ends = np.arange(len(rows) + 1) * len(near)
    return sparse.csr_array((weight.ravel(), place.ravel(), ends), (len(rows), len(counts))), share * whole


def _rows(recording: Recording) -> np.ndarray:
    """Numbers of the kept rows, counted from each run's start."""
    return np.concatenate([np.arange(run.start, run.stop, recording.every) for run in recording.table.runs])


def kept_rows(recording: Recording, column: np.ndarray) -> np.ndarray:
    """A column (n,) of flags or numbers at the kept rows, not smoothed."""
    return column[_rows(recording)]


def _counts(recording: Recording, made: Equation) -> np.ndarray:
    """True for kept rows of which at least half of the Gaussian's weight is on rows that count."""
    if recording.width <= 0.0:
        return made.valid[_rows(recording)]
    return _averages(recording, made.name)[1] >= HALF


def _run_numbers(recording: Recording) -> np.ndarray:
    """For each kept row the number of its run."""
    return np.concatenate(
        [np.full(len(range(run.start, run.stop, recording.every)), i) for i, run in enumerate(recording.table.runs)]
    )


def _starts(recording: Recording) -> np.ndarray:
    """True for the first kept rows of each run, which have too few rows before them."""
    first = [
        np.arange(run.start, run.stop, recording.every) - run.start < ORDER * recording.every
        for run in recording.table.runs
    ]
    return np.concatenate(first)


def autoregression(residual: Array, valid: np.ndarray) -> Array:
    """Coefficients (0 ... ORDER,) that predict a residual from earlier ones, over rows that are valid throughout.

    The Bayesian information criterion chooses their number.
    """
    n = len(residual)
    if np.count_nonzero(valid) < 20 * ORDER:
        return np.zeros(0)
    lags = np.column_stack([residual[ORDER - lag : n - lag] for lag in range(1, ORDER + 1)])
    whole = np.logical_and.reduce([valid[ORDER - lag : n - lag] for lag in range(ORDER + 1)])
    rows = np.count_nonzero(whole)
    if rows < 10 * ORDER:
        return np.zeros(0)
    lags, now = lags[whole], residual[ORDER:][whole]
    best, found = rows * np.log(max(float(np.mean(now**2)), 1e-300)), np.zeros(0)
    for order in range(1, ORDER + 1):
        tried, *_ = np.linalg.lstsq(lags[:, :order], now, rcond=None)
        left = float(np.mean((now - lags[:, :order] @ tried) ** 2))
        criterion = rows * np.log(max(left, 1e-300)) + order * np.log(rows)
        if criterion < best and np.all(np.abs(np.roots(np.concatenate(([1.0], -tried)))) < 0.999):
            best, found = criterion, np.asarray(tried, dtype=float)
    return found


def autoregression_above(
    residual: Array, good: np.ndarray, share: float, width: float = 0.0, every: int = 1
) -> tuple[Array, float]:
    """(coefficients, deviation of the innovations) of noise, estimated above `share` of the rows' frequency only.

    Slower parts may belong to an effect. Below `share` the noise gets the spectrum of samples that remember the one
    before, under a Gaussian of `width` samples and with one in `every` kept. Its memory is the upper limit of a
    one-sided interval of 95 %, by Whittle's likelihood above `share`: what is seen there of a memory of 0.9 may as well
    be one of 0.8, which has a quarter of the power at low frequencies, and slow noise would be an effect. But noise has
    no more power below `share` than the residual, and at least that of the likeliest memory. The spectrum gives the
    autocorrelations, these give the coefficients (Yule and Walker), and the Bayesian information criterion chooses
    their number. good: rows that count; each unbroken stretch has its own periodogram.
    """
    stretches = [_periodogram(residual[rows]) for rows in _stretches(good)]
    frequencies, powers = (np.concatenate([each[part] for each in stretches] or [np.zeros(0)]) for part in (0, 1))
    alone = frequencies >= share
    if np.count_nonzero(alone) < 2 * ORDER:
        return np.zeros(0), float(np.std(residual[good])) if np.any(good) else 1.0
    tried = []
    for memory in MEMORIES:
        shape = _spectrum(frequencies[alone], memory, width, every)
        level = float(np.mean(powers[alone] / shape))
        tried.append((2.0 * float(np.sum(np.log(level * shape))), memory, level))
    best_one = min(tried)
    below, seen = frequencies[~alone], float(np.sum(powers[~alone]))
    _, memory, level = next(
        each
        for each in reversed(tried)
        if each is best_one
        or each[0] - best_one[0] <= ONE_SIDED
        and each[1] > best_one[1]
        and each[2] * float(np.sum(_spectrum(below, each[1], width, every))) <= seen
    )
    rows = sum(2 * len(f) for f, _ in stretches)
    correlations = np.zeros(ORDER + 1)
    for f, p in stretches:
        power = np.where(f < share, level * _spectrum(f, memory, width, every), p)
        turns = np.cos(2.0 * np.pi * np.outer(np.arange(ORDER + 1), f))
        correlations += turns @ power * (2.0 / rows)
    best, found, deviation = rows * float(np.log(correlations[0])), np.zeros(0), float(np.sqrt(correlations[0]))
    for order in range(1, ORDER + 1):
        forecast = linalg.solve_toeplitz(correlations[:order], correlations[1 : order + 1])
        left = float(correlations[0] - forecast @ correlations[1 : order + 1])
        criterion = rows * float(np.log(max(left, 1e-300))) + order * float(np.log(rows))
        if criterion < best:
            best, found, deviation = criterion, np.asarray(forecast), float(np.sqrt(max(left, 0.0)))
    return found, deviation


def _spectrum(frequency: Array, memory: float, width: float, every: int) -> Array:
    """Spectrum up to a factor, at parts of the rows' frequency, of samples with this memory, smoothed and decimated."""
    total = np.zeros_like(frequency)
    for fold in range(-(every // 2), every // 2 + 1):  # aliases of the decimation
        turn = 2.0 * np.pi * (frequency + fold) / every
        total += np.exp(-((turn * width) ** 2)) / (1.0 + memory**2 - 2.0 * memory * np.cos(turn))
    return total


def _stretches(good: np.ndarray) -> list[slice]:
    """Unbroken stretches of rows, without short ones."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(int), [0]])))
    return [slice(a, b) for a, b in edges.reshape(-1, 2).tolist() if b - a > 8 * ORDER]


def _periodogram(residual: Array) -> tuple[Array, Array]:
    """Frequencies as parts of the rows' frequency, and power at each; a Hann window limits leakage of the slow part."""
    window = np.hanning(len(residual))
    power = np.abs(np.fft.rfft((residual - residual.mean()) * window)) ** 2 / float(window @ window)
    frequency = np.arange(1, len(power)) / len(residual)
    return frequency, np.maximum(power[1:], 1e-300)


@dataclasses.dataclass
class Part:
    """One equation over all recordings, unwhitened: n rows, p columns measured and their stand-ins."""

    response: Array
    measured: Array
    stand_in: Array
    valid: np.ndarray
    starts: np.ndarray
    repeats: np.ndarray
    run: np.ndarray  # number of the stretch without a gap

    def pure_error(self, residual: Array) -> tuple[Array, int]:
        """(residual less the mean of its repeats (n,), degrees of freedom); 0 degrees where repeats are too few."""
        counted = self.valid & (self.repeats >= 0)
        numbers, place, count = np.unique(self.repeats[counted], return_inverse=True, return_counts=True)
        freedom = int(np.count_nonzero(counted)) - len(numbers)
        if freedom < FEWEST_REPEATS:
            return residual, 0
        out = np.zeros_like(residual)
        out[counted] = residual[counted] - (np.bincount(place, residual[counted]) / count)[place]
        return out, freedom


@dataclasses.dataclass
class Whitening:
    """Coefficients and deviation that turn one equation's residual into white noise of deviation 1."""

    coefficients: Array
    deviation: float


@dataclasses.dataclass
class Noise:
    """The noise of some equations: whitening by equation, and correlations of innovations by pair of equations."""

    whitening: dict[str, Whitening]
    shared: dict[tuple[str, str], float] = dataclasses.field(default_factory=dict)


class Regression:
    """Equations of some recordings, whitened and solved, for tests of effects.

    response: (N,) whitened; measured, stand_in: (N, p) whitened columns of `names`; residual: (N,).
    """

    def __init__(
        self,
        recordings: Sequence[Recording],
        extra: Sequence[Columns] = (),
        extra_names: Sequence[str] = (),
        noise: "Regression | Noise | None" = None,
    ) -> None:
        """extra: more base columns, as an effect gives them: one {equation: (n, k)} per recording, by name. noise:
        known already, or another regression's; estimated from the residual when None."""
        self.recordings = list(recordings)
        self.equations = list(dict.fromkeys(name for each in recordings for name in each.equations))
        if noise is not None:  # the noise is unknown for an equation that the other regression does not have
            self.equations = [name for name in self.equations if name in noise.whitening]
        if not self.equations:
            there = ", ".join(recording.table.name for recording in self.recordings)
            raise UserError(f"{there}: no equation that the other recordings have can be made of it")
        made = (r.equations[name] for r in recordings for name in r.equations if name in self.equations)
        self.names = list(dict.fromkeys(name for each in made for name in each.columns))
        self.names += list(extra_names)
        self.count = len(self.names)
        self.parts = {name: self._part(name, extra, list(extra_names)) for name in self.equations}
        self.whitening: dict[str, Whitening] = dict(noise.whitening) if noise else {}
        known = noise.shared if noise else {}
        self.shared: dict[tuple[str, str], float] = {
            pair: each for pair, each in known.items() if set(pair) <= set(self.equations)
        }
        counted = sum(int(np.count_nonzero(self._good(name))) for name in self.equations)
        if counted <= 10 * (self.count - len(self._priors())):
            names = ", ".join(recording.table.name for recording in self.recordings)
            raise UserError(f"{names}: {counted} samples count, too few for {self.count} parameters")
        if noise is None:
            self._find_whitening()
        self._whiten()
        self.kept: dict[tuple[int, tuple[float, ...]], tuple[list[Columns], dict[str, Array]]] = {}

    def _part(self, equation: str, extra: Sequence[Columns], extra_names: list[str]) -> Part:
        """One equation over all recordings, unwhitened."""
        parts = []
        first_free = 0  # a recording's repeats are not repeats of another recording's rows
        runs = 0
        for number, recording in enumerate(self.recordings):
            rows = len(_rows(recording))
            repeats = kept_rows(recording, recording.repeats.get(equation, np.full(len(recording.table), -1)))
            repeats = np.where(repeats >= 0, repeats + first_free, -1)
            first_free = max(first_free, int(np.max(repeats, initial=-1)) + 1)
            run = runs + _run_numbers(recording)
            runs = int(np.max(run, initial=-1)) + 1
            measured = np.zeros((rows, self.count))
            made: Equation | None = recording.equations.get(equation)
            if made is None:
                nothing = np.zeros(rows, dtype=bool)
                parts.append((np.zeros(rows), measured, measured.copy(), nothing, _starts(recording), repeats, run))
                continue
            for name, column in made.columns.items():
                measured[:, self.names.index(name)] = reduced(recording, column, equation)
            stand_in = measured.copy()
            for name, column in made.stand_ins.items():
                stand_in[:, self.names.index(name)] = reduced(recording, column, equation)
            if extra and equation in extra[number]:
                first = self.count - len(extra_names)
                measured[:, first:] = stand_in[:, first:] = reduced(recording, extra[number][equation], equation)
            response, valid = reduced(recording, made.response, equation), _counts(recording, made)
            parts.append((response, measured, stand_in, valid, _starts(recording), repeats, run))
        return Part(*(np.concatenate(each) for each in zip(*parts, strict=True)))

    def _find_whitening(self) -> None:
        """Estimate the noise from the residual of a first fit, then solve again with that noise."""
        residuals = {}
        for _ in range(2):
            found = self._quick()
            for name, part in self.parts.items():
                residual = part.response - part.measured @ found
                residuals[name], freedom = part.pure_error(residual)
                least = LEAST * float(np.max(np.abs(part.response), initial=0.0)) or 1.0
                above = max(recording.noise_above for recording in self.recordings)
                if above and all(recording.whitened for recording in self.recordings):
                    coefficients, deviation = autoregression_above(
                        residual, part.valid & ~part.starts, above, self.recordings[0].width, self.recordings[0].every
                    )
                elif all(recording.whitened for recording in self.recordings):
                    coefficients = autoregression(np.where(part.valid, residual, 0.0), part.valid)
                    white = innovations(coefficients, residual)
                    good = self._good(name, coefficients)
                    deviation = float(np.sqrt(np.mean(white[good] ** 2))) if np.any(good) else 1.0
                else:
                    coefficients = np.zeros(0)
                    deviation = self._loudness(residuals[name][part.valid & ~part.starts], freedom)
                floor = max(recording.floors.get(name, 0.0) for recording in self.recordings)
                self.whitening[name] = Whitening(coefficients, max(float(np.hypot(deviation, floor)), least))
        for first, one in enumerate(self.equations):
            for other in self.equations[first + 1 :]:
                both = self._good(one) & self._good(other)
                if np.count_nonzero(both) > FEWEST_SHARED:
                    a, b = self._scaled(one, residuals[one])[both], self._scaled(other, residuals[other])[both]
                    self.shared[one, other] = float(np.clip(np.mean(a * b), -0.98, 0.98))

    def _loudness(self, noise: Array, freedom: int) -> float:
        """Deviation of a white noise with as little information as this one, whose samples are correlated.

        N_eff = N (1 - rho) / (1 + rho) with the first autocorrelation, of rows that count. freedom: of a pure error.
        """
        total = float(np.mean(noise**2)) if len(noise) else 1.0
        rho = float(np.mean(noise[1:] * noise[:-1])) / total if len(noise) > 1 and total > 0.0 else 0.0
        rho = min(max(rho, 0.0), *(recording.memory for recording in self.recordings))
        if freedom:
            total *= len(noise) / float(stats.chi2.ppf(1.0 - UPPER, freedom))
        return float(np.sqrt(total * (1.0 + rho) / (1.0 - rho)))

    def _good(self, equation: str, coefficients: Array | None = None) -> np.ndarray:
        """Rows that count: valid, with valid rows before them as far as the whitening reaches back."""
        part = self.parts[equation]
        good = part.valid & ~part.starts
        if coefficients is None and equation in self.whitening:
            coefficients = self.whitening[equation].coefficients
        for lag in range(1, 1 + (0 if coefficients is None else len(coefficients))):
            good[:lag] = False
            good[lag:] &= part.valid[:-lag] & (part.run[lag:] == part.run[:-lag])
        return good

    def _scaled(self, equation: str, column: Array) -> Array:
        whitening = self.whitening[equation]
        return innovations(whitening.coefficients, column) / whitening.deviation

    def _quick(self) -> Array:
        """Parameters with the whitening known so far."""
        measured, stand_ins, responses = [], [], []
        for name, part in self.parts.items():
            if name in self.whitening:
                good = self._good(name)
                columns = [self._scaled(name, each)[good] for each in (part.measured, part.stand_in, part.response)]
            else:
                level = float(np.std(part.response[part.valid])) if np.any(part.valid) else 1.0
                scale = max(level, 1e-12)
                columns = [each[part.valid] / scale for each in (part.measured, part.stand_in, part.response)]
            measured.append(columns[0])
            stand_ins.append(columns[1])
            responses.append(columns[2])
        known, wanted = self._prior_rows()
        measured.append(known)
        stand_ins.append(known)
        responses.append(wanted)
        stand_in = np.vstack(stand_ins)
        found = np.linalg.lstsq(stand_in.T @ np.vstack(measured), stand_in.T @ np.concatenate(responses), rcond=1e-10)
        return np.asarray(found[0], dtype=float)

    def _whiten(self) -> None:
        self.good = {name: self._good(name) for name in self.equations}
        self.response = self._stack({name: part.response for name, part in self.parts.items()})
        self.measured = self._stack({name: part.measured for name, part in self.parts.items()})
        self.stand_in = self._stack({name: part.stand_in for name, part in self.parts.items()})
        # rows of the priors follow the equations' rows; an effect is zero there
        known, wanted = self._prior_rows()
        self.response = np.concatenate([self.response, wanted])
        self.measured, self.stand_in = (np.vstack([each, known]) for each in (self.measured, self.stand_in))
        self.size = len(self.response)
        self.rows: dict[str, slice] = {}
        start = 0
        for name in self.equations:
            stop = start + int(np.count_nonzero(self.good[name]))
            self.rows[name] = slice(start, stop)
            start = stop
        self.both: dict[tuple[str, str], tuple[np.ndarray, np.ndarray]] = {}
        for one, other in self.shared:
            both = self.good[one] & self.good[other]
            self.both[one, other] = (
                self.rows_of(one).start + np.flatnonzero(both[self.good[one]]),
                self.rows_of(other).start + np.flatnonzero(both[self.good[other]]),
            )
        self._solve()

    def _priors(self) -> dict[str, tuple[float, float]]:
        """(value, standard deviation) of the parameters that are roughly known for sound machines."""
        known = {name: prior for recording in self.recordings for name, prior in recording.priors.items()}
        return {name: prior for name, prior in known.items() if name in self.names}

    def _prior_rows(self) -> tuple[Array, Array]:
        """(k, p) and (k,): the priors of sound machines as measurements of deviation 1."""
        known = self._priors()
        rows = np.zeros((len(known), self.count))
        for row, (name, (_, deviation)) in enumerate(known.items()):
            rows[row, self.names.index(name)] = 1.0 / deviation
        return rows, np.array([value / deviation for value, deviation in known.values()])

    def _solve(self) -> None:
        scale = np.linalg.norm(self.stand_in, axis=0)
        self.idle = [name for name, length in zip(self.names, scale, strict=True) if length == 0.0]
        scale = np.where(scale > 0.0, scale, 1.0)
        r, pivot = linalg.qr(self.stand_in / scale, mode="r", pivoting=True)
        rank = int(np.count_nonzero(np.abs(np.diag(r)) > RANK * abs(r[0, 0])))
        self.unseparable = sorted(self.names[number] for number in pivot[rank:] if self.names[number] not in self.idle)
        kept = np.sort(pivot[:rank])
        self.z = self.stand_in[:, kept] / scale[kept]
        self.phi = self.measured[:, kept] / scale[kept]
        self.inverse = np.linalg.inv(self.z.T @ self.phi)
        solved = np.zeros(self.count)
        solved[kept] = self.inverse @ (self.z.T @ self.response) / scale[kept]
        self._face()
        covariance = np.zeros((self.count, self.count))
        # equations that share a noisy channel carry less information together than independent ones
        noise = self.own.copy()
        for pair, correlation in self.shared.items():
            noise += correlation * (self.across[pair] + self.across[pair].T)
        spread = self.inverse @ noise @ self.inverse.T
        covariance[np.ix_(kept, kept)] = spread / np.outer(scale[kept], scale[kept])
        self.covariance = covariance
        self.values = dict(zip(self.names, (float(each) for each in solved), strict=True))
        self.residual = self.response - self.measured @ solved
        self.chi2 = float(self.residual @ self.residual)

    def _face(self) -> None:
        """Products of z; for equations that share noise also between them, and for the rows of each the other's z."""
        self.own = self.z.T @ self.z
        self.across: dict[tuple[str, str], Array] = {}
        self.facing: dict[tuple[tuple[str, str], str], Array] = {}
        for pair, rows in self.both.items():
            self.across[pair] = self.z[rows[0]].T @ self.z[rows[1]]
            for name, own, others in zip(pair, rows, rows[::-1], strict=True):
                facing = np.zeros((self.rows[name].stop - self.rows[name].start, self.z.shape[1]))
                facing[own - self.rows[name].start] = self.z[others]
                self.facing[pair, name] = facing

    def _stack(self, columns: Mapping[str, Array]) -> Array:
        """One whitened column (N,) or matrix (N, k) from unwhitened ones by equation."""
        scaled = {name: self._scaled(name, column) for name, column in columns.items()}
        return np.concatenate([scaled[name][self.good[name]] for name in self.equations])

    def columns(self, made: Sequence[Columns]) -> Array:
        """An effect's columns, one {equation: (n, k)} per recording, whitened and orthogonal to the base: (N, k)."""
        return self.beside(self.full(self.whitened(made)))

    def beside(self, stacked: Array) -> Array:
        """The part of whitened columns (N, k) that the base does not explain.

        The residual is (1 - phi (z^T phi)^-1 z^T) noise; so a column's product with it is the product of this part with
        the noise, and its variance is this part's squared length.
        """
        return stacked - self.z @ (self.inverse.T @ (self.phi.T @ stacked))

    def inflation(self, white: Mapping[str, Array], shadow: Array, gram: Array) -> float:
        """Factor by which the chi-square of whitened columns, projected off the base, exceeds chance; at least 1.

        Equations that share a noisy channel have correlated residuals. This affects only a column that is in both;
        there the variance of its product with the residual grows by the correlation.
        """
        total = max(float(np.trace(gram)), 1e-300)
        worst = 1.0
        for pair, correlation in self.shared.items():
            product = np.sum(shadow * (self.across[pair] @ shadow), axis=0)
            for name in pair:
                if name in white:
                    product -= np.sum((white[name].T @ self.facing[pair, name]).T * shadow, axis=0)
            if pair[0] in white and pair[1] in white:
                here, there = (
                    rows - self.rows_of(name).start for rows, name in zip(self.both[pair], pair, strict=True)
                )
                product += np.sum(white[pair[0]][here] * white[pair[1]][there], axis=0)
            worst += 2.0 * abs(correlation) * float(np.max(np.abs(product), initial=0.0)) * len(gram) / total
        return worst

    def whitened(self, made: Sequence[Columns]) -> dict[str, Array]:
        """An effect's whitened columns, not projected: by equation (n, k), only where the effect enters."""
        width = next(column.shape[1] for each in made for column in each.values())
        out = {}
        for name in self.equations:
            if not any(name in each and name in r.equations for r, each in zip(self.recordings, made, strict=True)):
                continue
            parts = []
            for recording, each in zip(self.recordings, made, strict=True):
                if name in each and name in recording.equations:
                    parts.append(reduced(recording, each[name], name))
                else:
                    parts.append(np.zeros((len(_rows(recording)), width)))
            out[name] = self._scaled(name, np.vstack(parts))[self.good[name]]
        return out

    def whitened_once(self, key: tuple[int, tuple[float, ...]], made: list[Columns]) -> dict[str, Array]:
        """As `whitened`, of an effect at a shape; with the very same columns as before the answer is the same one."""
        before = self.kept.get(key)
        if before is None or any(old is not new for old, new in zip(before[0], made, strict=True)):
            before = self.kept[key] = made, self.whitened(made)
        return before[1]

    def full(self, white: Mapping[str, Array]) -> Array:
        """(N, k) from whitened columns by equation."""
        width = next(iter(white.values())).shape[1]
        out = np.zeros((self.size, width))
        for name, columns in white.items():
            out[self.rows[name]] = columns
        return out

    def shadow(self, white: Mapping[str, Array]) -> Array:
        """(p, k): coefficients of z that the projection off the base subtracts from whitened columns."""
        together = sum((self.phi[self.rows[name]].T @ columns for name, columns in white.items()), 0.0)
        return np.asarray(self.inverse.T @ together)

    def product(self, white: Mapping[str, Array], shadow: Array, other: Array) -> Array:
        """(k, m): whitened columns, projected off the base, times rows (N, m)."""
        straight = sum((columns.T @ other[self.rows[name]] for name, columns in white.items()), 0.0)
        return np.asarray(straight - shadow.T @ (self.z.T @ other))

    def gram(self, white: Mapping[str, Array], shadow: Array) -> Array:
        """(k, k): products of whitened columns with each other, projected off the base."""
        straight = sum((columns.T @ columns for columns in white.values()), 0.0)
        across = sum((columns.T @ self.z[self.rows[name]] for name, columns in white.items()), 0.0) @ shadow
        gram = np.asarray(straight - across - across.T + shadow.T @ self.own @ shadow)
        # a column that the base explains to the last digits leaves only rounding
        nothing = np.diag(gram) < NOTHING * np.diag(straight)
        gram[nothing, :] = gram[:, nothing] = 0.0
        return gram

    def rows_of(self, equation: str) -> slice:
        """Slice of an equation in the stacked rows."""
        return self.rows[equation]


def innovations(coefficients: Array, column: Array) -> Array:
    """Innovations of a column (n,) or columns (n, k): each row less its forecast from earlier ones, zeros before row
    0."""
    out = column.copy()
    for lag, coefficient in enumerate(coefficients, 1):
        out[lag:] -= coefficient * column[:-lag]
    return out


def orthonormal(columns: Array) -> Array:
    """(N, rank) basis of the columns."""
    lengths = np.linalg.norm(columns, axis=0)
    scaled = columns[:, lengths > 1e-9] / lengths[lengths > 1e-9]
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    strong = values > 1e-6
    return (scaled @ vectors[:, strong]) / np.sqrt(values[strong])


def explained(gram: Array, product: Array) -> tuple[float, int]:
    """(chi-square that columns explain of a residual, number of independent columns).

    gram: (k, k) of the columns; product: (k,) of them with the residual.
    """
    lengths = np.sqrt(np.maximum(np.diag(gram), 0.0))
    kept = lengths > 1e-9
    if not np.any(kept):
        return 0.0, 0
    scaled = gram[np.ix_(kept, kept)] / np.outer(lengths[kept], lengths[kept])
    values, vectors = np.linalg.eigh(scaled)
    strong = values > 1e-6
    projected = (vectors[:, strong].T @ (product[kept] / lengths[kept])) ** 2 / values[strong]
    return float(projected.sum()), int(np.count_nonzero(strong))


class NoEquations(Regression):
    """Of recordings that give no equation, which something else judges: a walk's twins."""

    def __init__(self) -> None:
        self.recordings, self.equations, self.names, self.count = [], [], [], 0
        self.parts, self.whitening, self.shared, self.values = {}, {}, {}, {}
