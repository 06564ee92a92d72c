"""A balance with a measured position, in its weak form: both sides are means under one triangle.

The second difference of a position over n rows *is* the mean of the acceleration under a triangle of that half width,
so that nothing is differentiated and nothing is lost between rows. Rates, frictions, candidates and inputs are means
under the same triangle, of what they are between the rows: the position is on a cubic spline, an input on straight
lines, on a cubic spline, or held. Compared at the rows instead, a chirp that is logged at 100 Hz was a friction on
every sound recording, and a ripple was too small by what it loses under the triangle.

An input that steps or bends between two rows, as a command at its limit does, does so at a time that the rows do not
show. Rows that this can move by more than their noise do not count, unless the input is held.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ranger_sim.sysid import signals
from ranger_sim.sysid.dataset import Array, Table

PARTS = 8  # of the time from row to row
CLEARLY = 0.98  # of what is left: an input is held only where that leaves less
FEWEST = 7  # rows of a run, in addition to the triangle's
RINGS = 3  # rows after which a spline's answer to a bend is a fiftieth
HALF = 0.5  # of what a row's neighbours at twice the distance miss it by: a corner at the rows' own distance
LOUD = 2.0  # deviations of what is left: a row that a corner can move by more does not count
KEPT = 0.6  # of the rows that count, at least: of a command that bends in nearly every row few would be left
LEAST = 1e-5  # of the channel's own size: less is the arithmetic's, and the channel's last digits
ROBUST = 0.6745  # median of the absolute values of a normal distribution, in deviations


class WeakForm:
    """Means of a recording under a triangle; all arrays have a value for each of the table's n rows.

    half_s: half width of the triangle, at least one row. acceleration: mean of the position's second derivative;
    complete: (n,) rows whose triangle is within their run; elsewhere values are of the part that is.
    """

    def __init__(self, table: Table, position: Array, half_s: float) -> None:
        self.table = table
        self.rows = max(1, round(half_s / table.step_s))
        weights = 1.0 - np.abs(np.arange(-self.rows * PARTS, self.rows * PARTS + 1)) / (self.rows * PARTS)
        self.weights = weights / np.sum(weights)
        self.complete = np.zeros(len(table), dtype=bool)
        self.acceleration = np.zeros(len(table))
        self.fine_rates: list[tuple[slice, Array]] = []
        self.fine_places: list[Array] = []
        for run in table.runs:
            count, reach = run.stop - run.start, self.rows
            if count < 2 * reach + FEWEST:
                continue
            inside = slice(run.start + reach, run.stop - reach)
            self.complete[inside] = True
            part = position[run]
            second = part[2 * reach :] - 2.0 * part[reach:-reach] + part[: -2 * reach]
            self.acceleration[inside] = second / (reach * table.step_s) ** 2
            spline = CubicSpline(np.arange(count) * table.step_s, part)
            self.fine_rates.append((run, spline(self._fine(count), 1)))
            self.fine_places.append(spline(self._fine(count)))

    def of_rate(self, made: Callable[[Array], Array] = lambda rate: rate) -> Array:
        """Mean of the rate, or of what is made of it."""
        out = np.zeros(len(self.table))
        for run, rate in self.fine_rates:
            out[run] = self._mean(made(rate))
        return out

    def of_place(self, made: Callable[[Array], Array]) -> Array:
        """Mean of what is made of the position."""
        out = np.zeros(len(self.table))
        for (run, _), place in zip(self.fine_rates, self.fine_places, strict=True):
            out[run] = self._mean(made(place))
        return out

    def straight(self, column: Array) -> Array:
        """Mean of a channel that goes from row to row in straight lines."""
        out = column.copy()
        for run, _ in self.fine_rates:
            count = run.stop - run.start
            out[run] = self._mean(np.interp(self._fine(count), np.arange(count) * self.table.step_s, column[run]))
        return out

    def smooth(self, column: Array) -> Array:
        """Mean of a channel that goes from row to row on a cubic spline."""
        out = column.copy()
        for run, _ in self.fine_rates:
            count = run.stop - run.start
            spline = CubicSpline(np.arange(count) * self.table.step_s, column[run])
            out[run] = self._mean(spline(self._fine(count)))
        return out

    def held(self, column: Array) -> Array:
        """Mean of a channel that stays at a row's value until the next row; at the step it is half way."""
        out = column.copy()
        for run, _ in self.fine_rates:
            part = np.repeat(column[run], PARTS)[: (run.stop - run.start - 1) * PARTS + 1]
            out[run] = self._mean(0.5 * (part + np.concatenate((part[:1], part[:-1]))))
        return out

    def corners(self, column: Array) -> Array:
        """(n,) what a step or a bend of a channel between two rows can change its mean by, near 0 where it is smooth.

        A row is compared with the cubic through its neighbours at one and at three rows' distance. A smooth channel's
        miss falls with the fourth power of the distance, a bend's with the first: half of it is a bend's at one row.
        """
        missed = np.zeros(len(column))
        for run, _ in self.fine_rates:
            c = column[run]
            between = (9.0 * (c[2:-4] + c[4:-2]) - c[:-6] - c[6:]) / 16.0
            missed[run.start + 3 : run.stop - 3] = HALF * np.abs(c[3:-3] - between)
        return self.straight(missed)

    def turning(self, rate: Array) -> NDArray[np.bool_]:
        """(n,) True where the rate's sign changes within the triangle, and within RINGS rows.

        Friction that sticks bends the rate there, which the position's spline follows with an error for some rows.
        """
        out, reach = np.zeros(len(self.table), dtype=bool), max(self.rows, RINGS)
        for run in self.table.runs:
            for at in np.flatnonzero(np.diff(np.sign(rate[run]))):
                middle = run.start + int(at)
                out[max(run.start, middle - reach) : min(run.stop, middle + reach + 2)] = True
        return out

    def _fine(self, count: int) -> Array:
        return np.asarray(np.arange((count - 1) * PARTS + 1) * (self.table.step_s / PARTS), dtype=float)

    def _mean(self, fine: Array) -> Array:
        padded = np.pad(fine, self.rows * PARTS, mode="edge")
        return np.asarray(sliding_window_view(padded, len(self.weights))[::PARTS] @ self.weights)


@dataclasses.dataclass(frozen=True)
class Way:
    """How a channel goes from row to row. name: in words; mean: (n,) under the triangle; sure: (n,) rows that no corner
    between rows can move by more than their noise."""

    name: str
    mean: Array
    sure: NDArray[np.bool_]


def way_between_rows(weak: WeakForm, column: Array, others: Array, counts: NDArray[np.bool_]) -> Way:
    """The way, "straight line", "smooth" or "held", with which the other columns, (n, k), leave least.

    counts: (n,) rows that count.
    """
    means = {"straight line": weak.straight(column), "smooth": weak.smooth(column), "held": weak.held(column)}
    left = {name: _left(others, mean, counts) for name, mean in means.items()}
    size = {name: float(np.linalg.norm(each)) for name, each in left.items()}
    name = "smooth" if size["smooth"] < size["straight line"] else "straight line"
    if size["held"] < CLEARLY * size[name]:
        return Way("held", means["held"], np.ones(len(column), dtype=bool))
    late = signals.per_run(weak.table, np.gradient, means[name])  # a channel that is late has more left, but no noise
    noise = float(np.median(np.abs(_left(np.column_stack([others, late]), means[name], counts)))) / ROBUST
    noise = max(noise, LEAST * float(np.std(column)))
    corners = weak.corners(column)
    limit = max(LOUD * noise, float(np.quantile(corners[counts], KEPT)))
    return Way(name, means[name], corners <= limit)


def _left(others: Array, column: Array, counts: NDArray[np.bool_]) -> Array:
    """What other columns, (n, k), leave of a column, (n,), in the rows that count."""
    found = np.linalg.lstsq(others[counts], column[counts], rcond=None)[0]
    return np.asarray(column[counts] - others[counts] @ found)
