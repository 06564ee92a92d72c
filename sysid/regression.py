"""Several linear balances over several recordings as one regression with white noise of deviation 1.

Each equation has its own noise: an autoregression of its residual whitens it, a deviation scales it; two equations
that share a noisy channel have correlated residuals, which is turned out of them row by row. What is left is ordinary
least squares, so that a sum of squares is a chi-square and a difference of two of them tests a hypothesis.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import linalg, ndimage
from scipy.signal import lfilter

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Columns, Equation, Recording

ORDER = 3  # of the autoregression: two for a filter, one more


def reduced(recording: Recording, column: Array) -> Array:
    """A column (n,) or (n, k) under the recording's Gaussian, every so many rows."""
    if recording.width > 0.0:
        out = np.empty_like(column, dtype=float)
        for run in recording.table.runs:
            out[run] = ndimage.gaussian_filter1d(column[run], recording.width, axis=0, mode="nearest")
        column = out
    return column[_rows(recording)]


def _rows(recording: Recording) -> np.ndarray:
    """Numbers of the rows that are kept, counted from each run's start."""
    return np.concatenate([np.arange(run.start, run.stop, recording.every) for run in recording.table.runs])


def kept_rows(recording: Recording, column: np.ndarray) -> np.ndarray:
    """A column (n,) of flags or numbers at the rows that are kept, not smoothed."""
    return column[_rows(recording)]


def _starts(recording: Recording) -> np.ndarray:
    """True for the first kept rows of each run, which have not enough others before them."""
    first = [
        np.arange(run.start, run.stop, recording.every) - run.start < ORDER * recording.every
        for run in recording.table.runs
    ]
    return np.concatenate(first)


def autoregression(residual: Array, valid: np.ndarray) -> Array:
    """Coefficients (ORDER,) that predict a residual from those before it, over rows that are valid throughout."""
    n = len(residual)
    if np.count_nonzero(valid) < 20 * ORDER:
        return np.zeros(ORDER)
    lags = np.column_stack([residual[ORDER - lag : n - lag] for lag in range(1, ORDER + 1)])
    whole = np.logical_and.reduce([valid[ORDER - lag : n - lag] for lag in range(ORDER + 1)])
    if np.count_nonzero(whole) < 10 * ORDER:
        return np.zeros(ORDER)
    found, *_ = np.linalg.lstsq(lags[whole], residual[ORDER:][whole], rcond=None)
    roots = np.roots(np.concatenate(([1.0], -found)))
    return np.asarray(found, dtype=float) if np.all(np.abs(roots) < 0.999) else np.zeros(ORDER)


@dataclasses.dataclass
class Whitening:
    """How one equation's residual becomes white noise of deviation 1."""

    coefficients: Array
    deviation: float


class Regression:
    """Equations of some recordings, whitened, and what is asked of them.

    response: (N,) whitened; base: (N, p) whitened columns of `names`; q: (N, p) orthonormal basis of the base.
    """

    def __init__(
        self,
        recordings: Sequence[Recording],
        extra: Sequence[Columns] = (),
        extra_names: Sequence[str] = (),
        noise: "Regression | None" = None,
        general: Sequence[Sequence[Columns]] = (),
        clean: "Regression | None" = None,
    ) -> None:
        """extra: more base columns, as an effect gives them: one {equation: (n, k)} per recording, named so. noise:
        another regression whose whitening is taken over. general: features, each one {equation: (n, k)} per recording,
        with which columns that have instruments are freed of their noise. clean: a regression of the same recordings
        whose freed columns are taken over."""
        self.recordings = list(recordings)
        self.equations = list(dict.fromkeys(name for each in recordings for name in each.equations))
        self.names = list(dict.fromkeys(name for r in recordings for e in r.equations.values() for name in e.columns))
        self.names += list(extra_names)
        self.count = len(self.names)
        self.parts = {name: self._part(name, extra, list(extra_names)) for name in self.equations}
        self.freed: list[str] = []  # parameters whose columns are free of their noise
        self._free_of_noise(general)
        if noise is None:
            self.whitening: dict[str, Whitening] = {}
            self.shared: dict[tuple[str, str], float] = {}
            self._find_whitening()
        else:
            self.whitening, self.shared = noise.whitening, noise.shared
        self._whiten()
        if clean is not None:
            for name in clean.freed:
                self.base[:, self.names.index(name)] = clean.base[:, clean.names.index(name)]
            self.freed = clean.freed
            self._solve()
        if general:
            self.purify(np.hstack([self.whitened(made) for made in general]))

    def _part(
        self, equation: str, extra: Sequence[Columns], extra_names: list[str]
    ) -> tuple[Array, Array, np.ndarray, np.ndarray]:
        """(response, base, valid, starts) of one equation over all recordings, unwhitened."""
        responses, bases, valids, starts = [], [], [], []
        for number, recording in enumerate(self.recordings):
            rows = len(_rows(recording))
            starts.append(_starts(recording))
            made: Equation | None = recording.equations.get(equation)
            base = np.zeros((rows, self.count))
            if made is None:
                responses.append(np.zeros(rows))
                valids.append(np.zeros(rows, dtype=bool))
                bases.append(base)
                continue
            for name, column in made.columns.items():
                base[:, self.names.index(name)] = reduced(recording, column)
            if extra and equation in extra[number]:
                first = self.count - len(extra_names)
                base[:, first:] = reduced(recording, extra[number][equation])
            responses.append(reduced(recording, made.response))
            valids.append(made.valid[_rows(recording)])
            bases.append(base)
        return np.concatenate(responses), np.vstack(bases), np.concatenate(valids), np.concatenate(starts)

    def _free_of_noise(self, general: Sequence[Sequence[Columns]]) -> None:
        """The first of the two stages on rows that are not whitened yet, so that the noise is found without it."""
        for equation, (_, base, valid, _) in self.parts.items():
            made = [r.equations[equation].instruments for r in self.recordings if equation in r.equations]
            names = [name for name in self.names if any(name in each for each in made)]
            if not names:
                continue
            kept = [number for number, name in enumerate(self.names) if name not in names]
            helpers = [base[:, kept]]
            for name in names:
                parts = []
                for recording in self.recordings:
                    there = recording.equations.get(equation)
                    if there is None or name not in there.instruments:
                        width = next(each[name].shape[1] for each in made if name in each)
                        parts.append(np.zeros((len(_rows(recording)), width)))
                    else:
                        parts.append(reduced(recording, there.instruments[name]))
                helpers.append(np.vstack(parts))
            for feature in general:
                width = next(column.shape[1] for each in feature for column in each.values())
                if any(equation in each for each in feature):
                    helpers.append(
                        np.vstack(
                            [
                                reduced(recording, each[equation])
                                if equation in each
                                else np.zeros((len(_rows(recording)), width))
                                for recording, each in zip(self.recordings, feature, strict=True)
                            ]
                        )
                    )
            all_helpers = np.hstack(helpers)
            lengths = np.linalg.norm(all_helpers[valid], axis=0)
            scaled = all_helpers[:, lengths > 0.0] / lengths[lengths > 0.0]
            for name in names:
                number = self.names.index(name)
                gram = scaled[valid].T @ scaled[valid]
                found = np.linalg.lstsq(gram, scaled[valid].T @ base[valid, number], rcond=1e-9)[0]
                base[:, number] = scaled @ found

    def _find_whitening(self) -> None:
        """Ordinary least squares, whose residuals tell the noise; once more with that noise."""
        residuals = {}
        for _ in range(2):
            found = self._quick()
            for name, (response, base, valid, _starts) in self.parts.items():
                residual = response - base @ found
                residuals[name] = residual
                coefficients = autoregression(np.where(valid, residual, 0.0), valid)
                white = lfilter(np.concatenate(([1.0], -coefficients)), [1.0], residual)
                good = self._good(name)
                deviation = float(np.sqrt(np.mean(white[good] ** 2))) if np.any(good) else 1.0
                self.whitening[name] = Whitening(coefficients, max(deviation, 1e-300))
        for first, one in enumerate(self.equations):
            for other in self.equations[first + 1 :]:
                both = self._good(one) & self._good(other)
                if np.count_nonzero(both) > 100:
                    a, b = self._scaled(one, residuals[one])[both], self._scaled(other, residuals[other])[both]
                    self.shared[one, other] = float(np.clip(np.mean(a * b), -0.98, 0.98))

    def _good(self, equation: str) -> np.ndarray:
        """Rows that count: valid with everything before them that the whitening looks at."""
        _, _, valid, starts = self.parts[equation]
        good = valid & ~starts
        for lag in range(1, ORDER + 1):
            good[lag:] &= valid[:-lag]
        good[:ORDER] = False
        return good

    def _scaled(self, equation: str, column: Array) -> Array:
        whitening = self.whitening[equation]
        white = lfilter(np.concatenate(([1.0], -whitening.coefficients)), [1.0], column, axis=0)
        return white / whitening.deviation

    def _quick(self) -> Array:
        """Parameters by least squares with the whitening known so far."""
        rows, responses = [], []
        for name, (response, base, valid, _) in self.parts.items():
            if name in self.whitening:
                good = self._good(name)
                rows.append(self._scaled(name, base)[good])
                responses.append(self._scaled(name, response)[good])
            else:
                scale = max(float(np.std(response[valid])) if np.any(valid) else 1.0, 1e-12)
                rows.append(base[valid] / scale)
                responses.append(response[valid] / scale)
        found, *_ = np.linalg.lstsq(np.vstack(rows), np.concatenate(responses), rcond=1e-10)
        return found

    def _whiten(self) -> None:
        self.good = {name: self._good(name) for name in self.equations}
        self.response = self._stack({name: part[0] for name, part in self.parts.items()})
        self.base = self._stack({name: part[1] for name, part in self.parts.items()})
        self.size = len(self.response)
        self.both: dict[tuple[str, str], tuple[np.ndarray, np.ndarray]] = {}
        for one, other in self.shared:
            both = self.good[one] & self.good[other]
            self.both[one, other] = (
                self.rows_of(one).start + np.flatnonzero(both[self.good[one]]),
                self.rows_of(other).start + np.flatnonzero(both[self.good[other]]),
            )
        self._solve()

    def _solve(self) -> None:
        if self.size <= 10 * self.count:
            raise UserError(f"{self.size} samples count, too few for {self.count} parameters")
        scale = np.linalg.norm(self.base, axis=0)
        self.idle = [name for name, length in zip(self.names, scale, strict=True) if length == 0.0]
        q, r, pivot = linalg.qr(self.base / np.where(scale > 0.0, scale, 1.0), mode="economic", pivoting=True)
        rank = int(np.count_nonzero(np.abs(np.diag(r)) > 1e-8 * abs(r[0, 0]))) if r.size else 0
        self.unseparable = sorted(self.names[number] for number in pivot[rank:] if self.names[number] not in self.idle)
        self.q = q[:, :rank]
        solved = np.zeros(self.count)
        inverse = linalg.solve_triangular(r[:rank, :rank], np.eye(rank))
        solved[pivot[:rank]] = inverse @ (self.q.T @ self.response)
        covariance = np.zeros((self.count, self.count))
        covariance[np.ix_(pivot[:rank], pivot[:rank])] = inverse @ inverse.T
        scale = np.where(scale > 0.0, scale, 1.0)
        self.covariance = covariance / np.outer(scale, scale)
        self.solution = solved / scale
        self.values = dict(zip(self.names, (float(each) for each in self.solution), strict=True))
        self.residual = self.response - self.q @ (self.q.T @ self.response)
        self.chi2 = float(self.residual @ self.residual)

    def _stack(self, columns: Mapping[str, Array]) -> Array:
        """One whitened column (N,) or matrix (N, k) from unwhitened ones by equation."""
        scaled = {name: self._scaled(name, column) for name, column in columns.items()}
        return np.concatenate([scaled[name][self.good[name]] for name in self.equations])

    def purify(self, features: Array) -> None:
        """Take the noise out of the columns that have instruments.

        Such a column is replaced by what the instruments, the other columns and these features (N, m) say of it: two
        stages of least squares. What it loses is noise and orthogonal to everything that is tested afterwards; with
        it in, the parameter would come out too small and its shadow would look like a misfit.
        """
        noisy: dict[str, list[Columns]] = {}
        for number, recording in enumerate(self.recordings):
            for equation in recording.equations.values():
                for name, instruments in equation.instruments.items():
                    noisy.setdefault(name, [{} for _ in self.recordings])[number][equation.name] = instruments
        if not noisy:
            return
        self.freed = list(noisy)
        kept = [number for number, name in enumerate(self.names) if name not in noisy]
        helpers = [self.whitened(made) for made in noisy.values()]
        basis = orthonormal(np.hstack([self.base[:, kept], *helpers, features]))
        for name in noisy:
            number = self.names.index(name)
            self.base[:, number] = basis @ (basis.T @ self.base[:, number])
        self._solve()

    def columns(self, made: Sequence[Columns]) -> Array:
        """An effect's columns, one {equation: (n, k)} per recording, whitened and orthogonal to the base: (N, k)."""
        return self.beside(self.whitened(made))

    def beside(self, stacked: Array) -> Array:
        """What of whitened columns (N, k) the base does not have."""
        return stacked - self.q @ (self.q.T @ stacked)

    def inflation(self, columns: Array) -> float:
        """How much larger than chance alone the chi-square of whitened columns (N, k) is, at least 1.

        Equations that share a noisy channel have correlated residuals. It matters only to a column that stands in
        both; there the variance of its product with the residual grows by the correlation.
        """
        total = float(np.sum(columns**2))
        worst = 1.0
        for (one, other), correlation in self.shared.items():
            here, there = self.both[one, other]
            product = float(np.max(np.abs(np.sum(columns[here] * columns[there], axis=0)), initial=0.0))
            worst += 2.0 * abs(correlation) * product * columns.shape[1] / max(total, 1e-300)
        return worst

    def whitened(self, made: Sequence[Columns]) -> Array:
        """The same, not made orthogonal to anything."""
        width = next(column.shape[1] for each in made for column in each.values())
        unwhitened = {}
        for name in self.equations:
            parts = []
            for recording, each in zip(self.recordings, made, strict=True):
                if name in each and name in recording.equations:
                    parts.append(reduced(recording, each[name]))
                else:
                    parts.append(np.zeros((len(_rows(recording)), width)))
            unwhitened[name] = np.vstack(parts)
        return self._stack(unwhitened)

    def rows_of(self, equation: str) -> slice:
        """Where an equation stands in the stacked rows."""
        start = 0
        for name in self.equations:
            stop = start + int(np.count_nonzero(self.good[name]))
            if name == equation:
                return slice(start, stop)
            start = stop
        raise KeyError(equation)


def orthonormal(columns: Array) -> Array:
    """(N, rank) basis of the columns."""
    lengths = np.linalg.norm(columns, axis=0)
    scaled = columns[:, lengths > 1e-9] / lengths[lengths > 1e-9]
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    strong = values > 1e-6
    return (scaled @ vectors[:, strong]) / np.sqrt(values[strong])


def explained(columns: Array, residual: Array) -> tuple[float, int]:
    """(chi-square that these columns (N, k) take out of the residual, how many of them are independent)."""
    lengths = np.linalg.norm(columns, axis=0)
    kept = lengths > 1e-9
    if not np.any(kept):
        return 0.0, 0
    scaled = columns[:, kept] / lengths[kept]
    gram = scaled.T @ scaled
    values, vectors = np.linalg.eigh(gram)
    strong = values > 1e-6
    projected = (vectors[:, strong].T @ (scaled.T @ residual)) ** 2 / values[strong]
    return float(projected.sum()), int(np.count_nonzero(strong))
