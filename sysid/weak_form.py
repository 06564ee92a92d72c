"""A balance with a measured position, in its weak form: both sides are means under one triangle.

The second difference of a position over n rows *is* the mean of the acceleration under a triangle of that half width,
so that nothing is differentiated and nothing is lost between rows. Rates, frictions and inputs are means under the
same triangle, of what they are between the rows: the position is on a cubic spline, an input on straight lines, or
held. Compared at the rows instead, a chirp that is logged at 100 Hz was a friction on every sound recording.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ranger_sim.sysid.dataset import Array, Table

PARTS = 8  # of the time from row to row
CLEARLY = 0.98  # of what is left: an input is held only where that leaves less
FEWEST = 5  # rows of a run, in addition to the triangle's


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

    def of_rate(self, made: Callable[[Array], Array] = lambda rate: rate) -> Array:
        """Mean of the rate, or of what is made of it."""
        out = np.zeros(len(self.table))
        for run, rate in self.fine_rates:
            out[run] = self._mean(made(rate))
        return out

    def straight(self, column: Array) -> Array:
        """Mean of a channel that goes from row to row in straight lines."""
        out = column.copy()
        for run, _ in self.fine_rates:
            count = run.stop - run.start
            out[run] = self._mean(np.interp(self._fine(count), np.arange(count) * self.table.step_s, column[run]))
        return out

    def held(self, column: Array) -> Array:
        """Mean of a channel that stays at a row's value until the next row; at the step it is half way."""
        out = column.copy()
        for run, _ in self.fine_rates:
            part = np.repeat(column[run], PARTS)[: (run.stop - run.start - 1) * PARTS + 1]
            out[run] = self._mean(0.5 * (part + np.concatenate((part[:1], part[:-1]))))
        return out

    def turning(self, rate: Array) -> NDArray[np.bool_]:
        """(n,) True where the rate's sign changes within the triangle."""
        out = np.zeros(len(self.table), dtype=bool)
        for run in self.table.runs:
            for at in np.flatnonzero(np.diff(np.sign(rate[run]))):
                middle = run.start + int(at)
                out[max(run.start, middle - self.rows) : min(run.stop, middle + self.rows + 2)] = True
        return out

    def _fine(self, count: int) -> Array:
        return np.asarray(np.arange((count - 1) * PARTS + 1) * (self.table.step_s / PARTS), dtype=float)

    def _mean(self, fine: Array) -> Array:
        padded = np.pad(fine, self.rows * PARTS, mode="edge")
        return np.asarray(np.convolve(padded, self.weights, mode="valid")[::PARTS])


def way_between_rows(weak: WeakForm, column: Array, others: Array, counts: NDArray[np.bool_]) -> tuple[Array, str]:
    """A channel's means, and its way, "straight line" or "held": with which the other columns, (n, k), leave less."""
    ways = {"straight line": weak.straight(column), "held": weak.held(column)}
    left = {}
    for name, each in ways.items():
        size = np.linalg.lstsq(others[counts], each[counts], rcond=None)[0]
        left[name] = float(np.linalg.norm(each[counts] - others[counts] @ size))
    name = "held" if left["held"] < CLEARLY * left["straight line"] else "straight line"
    return ways[name], name
