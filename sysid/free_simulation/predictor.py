"""The Kalman predictor and smoother of a simulator that was linearised about a trajectory."""

import dataclasses
from collections.abc import Collection, Mapping

import numpy as np
from scipy.linalg import lapack

from ranger_sim.sysid.dataset import Array

STRETCH = 400  # samples of a stretch; covariances of all stretches are computed side by side


@dataclasses.dataclass
class Jacobians:
    """The simulator about a trajectory. n samples, s states, i noisy inputs, p parameters, o outputs, q ports.

    next_state: (n, s) f; output: (n, o) h; the rest: their derivatives, `f_x` (n, s, s) to `h_q` (n, o, q).
    """

    next_state: Array
    output: Array
    f_x: Array
    f_u: Array
    f_p: Array
    f_q: Array
    h_x: Array
    h_u: Array
    h_p: Array
    h_q: Array


class Predictor:
    """The Kalman predictor of a linearised simulator: turns forcings into white prediction errors.

    A forcing has a part in the states, (n, s, k), and a part in the outputs, (n, o, k).
    """

    def __init__(self, lin: Jacobians, noise_u: Array, noise_y: Array, loose: Array, starts: np.ndarray, away: Array,
                 before: "Predictor | None" = None, stretch: int = STRETCH) -> None:  # fmt: skip
        """noise_u: (i,), noise_y: (o,) or (n, o) standard deviations; loose: (n, s) of each step; starts: samples at
        which the state is free, with standard deviations `away` (s,). before: of the last round of a fit."""
        n, s = lin.next_state.shape
        o = lin.output.shape[1]
        self.n, self.s, self.o = n, s, o
        self.h_x = lin.h_x
        variance = noise_u**2
        state_noise = (lin.f_u * variance) @ lin.f_u.transpose(0, 2, 1)
        state_noise[:, np.arange(s), np.arange(s)] += loose**2
        output_noise = (lin.h_u * variance) @ lin.h_u.transpose(0, 2, 1)
        output_noise[:, np.arange(o), np.arange(o)] += noise_y**2
        both_noise = (lin.f_u * variance) @ lin.h_u.transpose(0, 2, 1)
        is_start = np.zeros(n, dtype=bool)
        is_start[starts] = True
        # Side by side in stretches, each from the covariance at the end of the one before in the last round; in the
        # first round a stretch has no prior knowledge, which is textbook multiple shooting.
        free = np.asarray(np.diag(away**2), dtype=float)
        length = min(n, stretch)
        P: Array = np.tile(free, (-(-n // length), 1, 1))
        if before is not None:
            P[1:] = before.reached(np.arange(length, n, length))
        self.length = length

        def side_by_side(rows: Array) -> Array:
            """(length, stretches, ...) of (n, ...); what the last stretch lacks is its last row again."""
            lacking = len(P) * length - n
            whole = np.concatenate((rows, np.repeat(rows[-1:], lacking, axis=0))) if lacking else rows
            return np.ascontiguousarray(whole.reshape(len(P), length, *rows.shape[1:]).swapaxes(0, 1))

        def in_turn(rows: Array) -> Array:
            return np.ascontiguousarray(rows.swapaxes(0, 1).reshape(-1, *rows.shape[2:])[:n])

        A_all, C_all, Q_all, R_all, S_all, begins = (
            side_by_side(each) for each in (lin.f_x, lin.h_x, state_noise, output_noise, both_noise, is_start)
        )
        begin = np.any(begins, axis=1).tolist()
        C_turned = np.ascontiguousarray(C_all.swapaxes(2, 3))
        covariance, gain, spread = (np.empty((length, len(P), *shape)) for shape in ((s, s), (s, o), (o, o)))
        for k in range(length):
            if begin[k]:
                P[begins[k]] = free
            A, C, S = A_all[k], C_all[k], S_all[k]
            PC = P @ C_turned[k]
            error = C @ PC + R_all[k]
            K = _divided(A @ PC + S, error)
            covariance[k], gain[k], spread[k] = P, K, error
            # Joseph's form: a sum of squares, which stays positive where the sensors' noise is next to nothing
            inner, K_turned = A - K @ C, K.swapaxes(1, 2)
            less = S @ K_turned
            P = inner @ P @ inner.swapaxes(1, 2) + K @ R_all[k] @ K_turned + Q_all[k] - less - less.swapaxes(1, 2)
            P = 0.5 * (P + P.swapaxes(1, 2))
        self.ends: Array = P  # (stretches, s, s) covariances at the end of each stretch
        self.covariance, self.gain = in_turn(covariance), in_turn(gain)
        self.spread = in_turn(spread)  # Cholesky factor of the prediction error's covariance
        self.spread = np.asarray(np.linalg.cholesky(self.spread), dtype=float)
        self.unspread = np.linalg.inv(self.spread)
        self.inner = lin.f_x - self.gain @ lin.h_x
        self.inner[starts[1:] - 1] = 0.0
        self.into = np.ones((n, 1, 1))  # a start forgets the forcing of the sample before it
        self.into[starts[1:] - 1] = 0.0
        # Rows of the recursion x[k+1] - inner[k] x[k] = forcing[k] as a banded lower triangle
        self.band = np.zeros((2 * s, n * s))
        self.band[0] = 1.0
        for row in range(s):
            for column in range(s):
                place = np.arange(n - 1) * s + column
                self.band[s + row - column, place] = -self.inner[:-1, row, column]
        # in units of the channels: the errors are white, and as large as the middle one
        self.unit = np.median(np.abs(self.spread[:, np.arange(o), np.arange(o)]), axis=0)
        self._unknown: tuple[Array, Array] | None = None  # directions (n o, m) of unknown numbers, and parts to take

    def reached(self, samples: np.ndarray) -> Array:
        """(m, s, s) covariances before these samples, by what comes before them.

        At a stretch's start it is that of the end of the one before, which knows more than the stretch began with.
        """
        found: Array = self.covariance[samples]
        begin = (samples > 0) & (samples % self.length == 0)
        found[begin] = self.ends[samples[begin] // self.length - 1]
        return found

    def _march(self, forcing: Array, backward: bool = False) -> Array:
        """x (n, s, k) with x[0] = forcing[0] and x[k] = inner[k-1] x[k-1] + forcing[k]; or its transpose."""
        k = forcing.shape[2]
        flat = forcing.reshape(self.n * self.s, k)
        out, info = lapack.dtbtrs(self.band, flat, uplo="L", trans="T" if backward else "N", diag="U")
        if info:
            raise AssertionError(f"dtbtrs: {info}")
        return np.asarray(out, dtype=float).reshape(self.n, self.s, k)

    def errors(self, state: Array, output: Array) -> Array:
        """(n, o, k) prediction errors of forcings, not whitened."""
        return self.predicted(state, output)[1]

    def predicted(self, state: Array, output: Array) -> tuple[Array, Array]:
        """((n, s, k) deviations of the predicted states, (n, o, k) prediction errors) of forcings, not whitened."""
        driven = np.zeros_like(state)
        driven[1:] = (self.into * (state - self.gain @ output))[:-1]
        x = self._march(driven)
        return x, self.h_x @ x + output

    def white(self, errors: Array) -> Array:
        """(n, o, k) of one deviation each, in the channels' units."""
        return self.known((self.unspread @ errors) * self.unit[None, :, None])

    def forget(self, white: Array) -> None:
        """From now on white errors are those with further unknown numbers, each of mean 0 and deviation 1, of which a
        unit adds these columns (n, o, m)."""
        columns = (white / self.unit[None, :, None]).reshape(self.n * self.o, -1)
        directions, sizes, _ = np.linalg.svd(columns, full_matrices=False)
        self._unknown = directions, 1.0 - 1.0 / np.sqrt(1.0 + sizes**2)

    def known(self, white: Array) -> Array:
        """White errors (n, o, k), or (n, o), after the unknown numbers of `forget`, if there are any: white again."""
        if self._unknown is None:
            return white
        directions, parts = self._unknown
        unit = self.unit[:, None] if white.ndim == 3 else self.unit
        flat = (white / unit).reshape(self.n * self.o, -1)
        less: Array = directions @ (parts[:, None] * (directions.T @ flat))
        return (flat - less).reshape(white.shape) * unit

    def left(self, state: Array, output: Array) -> Array:
        """(n, o) errors of the first of these forcings, of one deviation each, after the others took what they can."""
        white = self.white(self.errors(state, output)) / self.unit[None, :, None]
        stacked = white.reshape(-1, white.shape[2])
        a, b = stacked[:, 1:], stacked[:, 0]
        return np.asarray(b - a @ np.linalg.lstsq(a, b, rcond=1e-9)[0]).reshape(white.shape[:2])

    @property
    def surprise_of_spread(self) -> float:
        """The part of -2 log likelihood, up to a constant, that is of the errors' spread and not of the errors."""
        return 2.0 * float(np.sum(np.log(self.spread[:, np.arange(self.o), np.arange(self.o)])))

    def smoothed(self, x: Array, error: Array, f_u: Array, h_u: Array, noise_u: Array) -> tuple[Array, Array]:
        """(n, s) and (n, i): the most probable deviations of states and noisy inputs, given all samples.

        x, error: (n, s), (n, o), of the response, as `predicted` (Bryson and Frazier's form of the smoother).
        """
        weighed = self.unspread.transpose(0, 2, 1) @ (self.unspread @ error[:, :, None])
        adjoint = self._march(self.h_x.transpose(0, 2, 1) @ weighed, backward=True)
        after = self.into * np.concatenate((adjoint[1:], np.zeros_like(adjoint[:1])))
        states = -x[:, :, None] + self.covariance @ adjoint
        weighed_less = weighed - self.gain.transpose(0, 2, 1) @ after
        inputs = h_u.transpose(0, 2, 1) @ weighed_less + f_u.transpose(0, 2, 1) @ after
        return states[:, :, 0], noise_u**2 * inputs[:, :, 0]


def _divided(a: Array, by: Array) -> Array:
    """a (m, s, o) times the inverses of symmetric positive matrices (m, o, o)."""
    if by.shape[1] == 1:
        return np.asarray(a / by)
    if by.shape[1] == 2:
        one, both, two = by[:, :1, 0], by[:, :1, 1], by[:, 1:, 1]
        with np.errstate(divide="ignore"):  # of a machine that runs away; its likelihood is judged as no number
            share = 1.0 / (one * two - both * both)
        out = np.empty_like(a)
        out[:, :, 0] = (a[:, :, 0] * two - a[:, :, 1] * both) * share
        out[:, :, 1] = (a[:, :, 1] * one - a[:, :, 0] * both) * share
        return out
    return np.asarray(np.linalg.solve(by, a.swapaxes(1, 2)).swapaxes(1, 2))


def between(column: Array) -> Array:
    """(n, k): means of each sample and the next, for the step between them."""
    after = np.concatenate((column[1:], column[-1:]))
    return np.asarray(0.5 * (column + after))


def forcing(
    lin: Jacobians, entering: Mapping[int, Array], held: Collection[int], means: Collection[int] = ()
) -> tuple[Array, Array]:
    """((n, s, k), (n, o, k)) forcings of what enters, (n, k) by number of its port; held: ports that hold a sample's
    value until the next; means: those in which the next sample's value is the step's."""
    n, s = lin.next_state.shape
    count = next(iter(entering.values())).shape[1]
    state, output = np.zeros((n, s, count)), np.zeros((n, lin.output.shape[1], count))
    for number, column in entering.items():
        if number in means:
            through = np.concatenate((column[1:], column[-1:]))
        else:
            through = column if number in held else between(column)
        state += lin.f_q[:, :, number, None] * through[:, None]
        output += lin.h_q[:, :, number, None] * column[:, None]
    return state, output
