"""Forms that lags and changes have in every machine, with their grids: a delay or a filter, settling or a jump.

A balance and a machine given by its simulator have the same ones, under the same names. A grid suits the recordings; a
shape on it is refined where a cause is found.
"""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.machine import Recording

FINEST_LAG, COARSER = 0.5, 1.6  # samples; from one lag of the grid to the next
NEAR = 2.0  # times a lag of the grid: what a lag made with it may come out as, but for the shortest
# What was there before a run: of a delay at most so many numbers, and of all runs together. Chosen by us
MOST_BEFORE, MOST_BEFORE_RUNS = 8, 40
ROUNDED = 1e-6  # of a delay: a row that is so much less after a start is after it
MOST_LAG_SAMPLES, LAGS_IN_A_RECORDING = 400, 20.0  # a lag is shorter, and so many fit into the recording
JUMPED = (0.03, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 0.97)  # of the longest recording: when something jumps
SETTLED = (0.15, 0.5, 1.5, 5.0)  # of the longest recording: time constants of a parameter that settles

Shape = Mapping[str, float]


@dataclasses.dataclass(frozen=True)
class Lag:
    """A form of a sensor's lag. time: name of its shape; late(table, columns, lag_s): columns (n,) or (n, k) behind it;
    remembered(since_s, lag_s, most): (rows, m) what each of at most so many numbers from before a run adds since its
    start; reaches: times the lag that what it shows depends on; words: after a sensor's name."""

    form: str
    time: str
    late: Callable[[Table, Array, float], Array]
    remembered: Callable[[Array, float, int], Array]
    reaches: float
    words: str

    def shapes(self, recordings: Sequence[Recording]) -> list[Shape]:
        return [{self.time: each} for each in lags(recordings)]

    def fits(self, recordings: Sequence[Recording]) -> Callable[[Mapping[str, float]], bool]:
        """True for a lag that comes out near the one with which it was made; the shortest is of first order."""
        shortest = lags(recordings)[0]

        def near(found: Mapping[str, float]) -> bool:
            return found[self.time] <= shortest or 1.0 / NEAR < found["lag_s"] / found[self.time] < NEAR

        return near

    def before(self, table: Table, column: Array, late: Array, lag_s: float) -> Array:
        """(n, m) what was there before each run may add to `late`, each column with a deviation of 1: as much as the
        column (n,) usually changes by the lag."""
        most = max(1, min(MOST_BEFORE, MOST_BEFORE_RUNS // len(table.runs)))
        found = []
        for run in table.runs[:MOST_BEFORE_RUNS]:
            remembered = self.remembered(table.time_s[run] - table.time_s[run][0], lag_s, most)
            columns = np.zeros((len(table), remembered.shape[1]))
            columns[run] = remembered
            found.append(columns)
        return np.hstack(found) * np.sqrt(np.mean((late - column) ** 2))


@dataclasses.dataclass(frozen=True)
class Change:
    """A form of a change during the run. factor(elapsed_s, shape): (n,) by which its size is multiplied; of a ramp the
    size is one per second. words: with `{}` for the name of the size; scale, once: of `Effect`."""

    form: str
    factor: Callable[[Array, Shape], Array]
    words: str
    shapes: Callable[[Sequence[Recording]], Sequence[Shape]]
    scale: str | None = None
    once: bool = False


def lags(recordings: Sequence[Recording]) -> list[float]:
    """Grid of lags in seconds: from half a sample to a part of the shortest recording, each longer by a factor."""
    table = min((each.table for each in recordings), key=len)
    most = min(float(MOST_LAG_SAMPLES), len(table) / LAGS_IN_A_RECORDING)
    grid = itertools.takewhile(lambda lag: lag <= most, (FINEST_LAG * COARSER**n for n in itertools.count()))
    return [each * table.step_s for each in (*grid, most)]


def delayed(table: Table, column: Array, lag_s: float) -> Array:
    """Columns (n,) or (n, k) as they were `lag_s` before, on cubics between rows; a run's first value before its start.

    Straight lines would smooth what is late by half a row, as another sensor does.
    """
    out = np.empty_like(column)
    for run in table.runs:
        stamps, values = table.time_s[run], column[run]
        before = np.maximum(stamps - lag_s, stamps[0])
        out[run] = CubicSpline(stamps, values)(before) if len(stamps) > 1 else values
    return out


def filtered(table: Table, column: Array, lag_s: float) -> Array:
    """Columns (n,) or (n, k) behind a low-pass of first order with this time constant, exact for straight lines in
    between."""
    ratio = table.step_s / lag_s
    kept = float(np.exp(-ratio))
    through = (1.0 - kept) / ratio
    out = np.empty_like(column)
    for run in table.runs:
        first = through * column[run][:1]  # so that the first value is the column's own
        out[run], _ = lfilter([1.0 - through, through - kept], [1.0, -kept], column[run], axis=0, zi=first)
    return out


def _of_a_delay(since_s: Array, lag_s: float, most: int) -> Array:
    """Values of each row that shows what was before the start, or of some with straight lines in between; the less
    unlike the first value, the nearer to it."""
    rows = int(np.count_nonzero(lag_s - since_s > ROUNDED * lag_s))
    knots = np.linspace(0.0, rows - 1.0, min(rows, most))
    hats = [np.interp(np.arange(rows), knots, one) for one in np.eye(len(knots))]
    out = np.zeros((len(since_s), len(knots)))
    out[:rows] = np.column_stack(hats) * np.sqrt(1.0 - since_s[:rows, None] / lag_s)
    return out


def _of_a_filter(since_s: Array, lag_s: float, most: int) -> Array:
    """The filter's value, which is forgotten with its time constant."""
    return np.exp(-since_s[:, None] / lag_s)


def jumped(elapsed_s: Array, shape: Shape) -> Array:
    """(n,) 0 before the jump and 1 from it on."""
    return np.where(elapsed_s < shape["at_s"], 0.0, 1.0)


def longest_s(recordings: Sequence[Recording]) -> float:
    return max(float(np.ptp(each.table.time_s)) for each in recordings)


def jumps(recordings: Sequence[Recording]) -> list[Shape]:
    """Grid of times at which something jumps."""
    return [{"at_s": share * longest_s(recordings)} for share in JUMPED]


def settlings(recordings: Sequence[Recording]) -> list[Shape]:
    """Grid of time constants with which something settles."""
    return [{"tau_s": share * longest_s(recordings)} for share in SETTLED]


DELAY = Lag("delay", "delay_s", delayed, _of_a_delay, 1.2, "is late: it shows the true value of lag_s before")
FILTER = Lag(
    "filter", "time_constant_s", filtered, _of_a_filter, 5.0,
    "lags: it shows the true value behind a low-pass of first order with the time constant lag_s",
)  # fmt: skip
LAGS = (DELAY, FILTER)

RAMP = Change("ramp", lambda t, _: t, "{} * time since the recording's start", lambda _: [{}])
SETTLING = Change(
    "settling", lambda t, shape: -np.expm1(-t / shape["tau_s"]),
    "{} * (1 - exp(-time since the recording's start / tau_s))", settlings, "tau_s",
)  # fmt: skip
JUMP = Change("jump", jumped, "{} from at_s after the recording's start on", jumps, "at_s", once=True)
CHANGES = (RAMP, SETTLING, JUMP)
