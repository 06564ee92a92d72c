"""Filters and derivatives for measured signals, without phase, run by run.

A balance is a linear equation between signals and their derivatives. Filtered by one filter on both sides it holds as
before, and the derivative of the filtered signal is the filtered derivative: so derivatives are taken with the
derivative of the same Gaussian that smooths everything else.
"""

import dataclasses
import itertools
import math
from collections.abc import Callable, Collection, Iterable

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter, savgol_filter

from ranger_sim.sysid.dataset import Array, Table
from ranger_sim.sysid.lattice import lattice_step

Rows = NDArray[np.bool_]

# Samples: no narrower is a Gaussian whose own derivative is taken; a slope is then right to a part in a thousand.
NARROW = 0.75
JUMP, JUMPS_BY = 0.1, 8.0  # of the range, and times the median change: larger is a jump
# Of a channel that is cut off: samples of one number in a stretch, stretches, part of the usual slope at which it
# arrives there, and different numbers of a channel that has only states
FLAT, FEWEST_FLATS, STEEP, FEW_NUMBERS = 3, 2, 0.2, 20
PASSED = 5.0  # counts, by the usual slope, over which the slope is taken at which it arrives. Chosen by us
NEAR = 0.25  # steps: a row so near to a recorded one is that. Chosen by us
LOST = 1.5  # steps: rows farther apart lack one between them. Chosen by us
SHORTEST_WINDOW = 7  # rows
# Power of the window: a random walk's departure grows with 0.5, a motion's with 3. Chosen by us, so that what counts as
# noise is at most 1.6 times too large next to a sine
GROWS = 0.75
COUNTED = 0.3  # of a channel's counts: below it these are not seen yet; rounding alone is 0.29 of one
ROUGH_S = 0.1  # window in which a parabola separates a channel's own noise from its course
HELD_JUMPS = 0.2  # of the samples at most: a channel that changes at no more of them is held in between
FEWEST_RETURNS = 5  # of rows that go to the next count and back, in a channel of counts. Chosen by us
SMOOTHER = 0.25  # of the straight lines' square that a cubic leaves: there it is the better way between samples


def per_run(table: Table, work: Callable[..., Array], *columns: Array) -> Array:
    """`work` on each run of the columns, put together again; shape (n,)."""
    out = np.empty(len(table))
    for run in table.runs:
        out[run] = work(*(column[run] for column in columns))
    return out


def smooth(table: Table, column: Array, width: float) -> Array:
    """The column under a Gaussian whose standard deviation is `width` samples; a run's end repeats its last value."""
    return per_run(table, lambda part: ndimage.gaussian_filter1d(part, width, mode="nearest"), column)


def derivative(table: Table, column: Array, width: float) -> Array:
    """Rate per second of the smoothed column.

    The derivative of a narrow Gaussian, taken at samples, makes a rate too small, at 0.3 of one by eleven twelfths.
    Below `NARROW` therefore by differences of the smoothed column over two samples.
    """
    step_s = table.step_s
    if width < NARROW:
        smoothed = smooth(table, column, width)
        return per_run(table, lambda part: np.gradient(part, step_s) if len(part) > 1 else np.zeros(1), smoothed)
    return per_run(table, lambda part: ndimage.gaussian_filter1d(part, width, order=1, mode="nearest") / step_s, column)


def lagged(table: Table, column: Array, time_constant_s: float) -> Array:
    """Behind a first-order filter that starts at rest in 0."""
    keep = math.exp(-table.step_s / time_constant_s)
    return per_run(table, lambda part: lfilter([1.0 - keep], [1.0, -keep], part), column)


def integral(table: Table, column: Array) -> Array:
    """By trapezoids over the whole recording, 0 at its start; a gap counts as a straight line."""
    steps = np.diff(table.time_s, prepend=table.time_s[0])
    between = np.concatenate(([column[0]], 0.5 * (column[1:] + column[:-1])))
    return np.cumsum(steps * between)


def uniform(table: Table) -> Table:
    """The table on even stamps, run by run, each column by straight lines; itself when they are even already.

    A lost row is unmeasured, and on a cubic where the column is smooth: an input is needed there all the same.
    """
    step_s = table.step_s
    if np.max(np.abs(np.diff(table.time_s) - step_s), initial=0.0, where=_inside(table)) < 0.01 * step_s:
        return table
    stamps: list[Array] = []
    columns: dict[str, list[Array]] = {name: [] for name in table.columns}
    unmeasured: dict[str, list[Rows]] = {name: [] for name in table.unmeasured}
    losses: list[Rows] = []
    runs: list[slice] = []
    start = 0
    for run in table.runs:
        time_s = table.time_s[run]
        even = time_s[0] + step_s * np.arange(int((time_s[-1] - time_s[0]) / step_s + 0.5) + 1)
        even = even[even <= time_s[-1] + 1e-9]
        stamps.append(even)
        for name, column in table.columns.items():
            columns[name].append(np.interp(even, time_s, column[run]))
        for name, rows in table.unmeasured.items():
            unmeasured[name].append(np.interp(even, time_s, rows[run]) > 0.0)
        losses.append(_lost(even, time_s, step_s))
        runs.append(slice(start, start + len(even)))
        start += len(even)
    lost = np.concatenate(losses)
    made = Table(
        np.concatenate(stamps),
        {name: np.concatenate(parts) for name, parts in columns.items()},
        tuple(runs),
        table.name,
        table.resolution,
        {name: np.concatenate(parts) | lost for name, parts in unmeasured.items()},
        {name: counts_of(table, name) for name in table.columns},
        table.begin_s,
    )
    if np.any(lost):
        made.unmeasured = {name: made.unmeasured.get(name, lost) for name in made.columns}
        for column in made.columns.values():
            if is_smooth(made, column):
                known = made.time_s[~lost], column[~lost]
                column[lost] = CubicSpline(*known)(made.time_s[lost])
    return made


def _lost(even: Array, time_s: Array, step_s: float) -> Rows:
    """(n,) True for even stamps between two recorded ones that lack a row between them."""
    place = np.clip(np.searchsorted(time_s, even), 1, max(1, len(time_s) - 1))
    if len(time_s) < 2:
        return np.zeros(len(even), dtype=bool)
    near = np.minimum(np.abs(even - time_s[place - 1]), np.abs(time_s[place] - even))
    return np.asarray((time_s[place] - time_s[place - 1] > LOST * step_s) & (near > NEAR * step_s))


def cut_where_lost(table: Table, names: Collection[str], held: bool) -> Table:
    """The table with a new run after each lost row over which one of these channels changes.

    held: smooth ones as well. What a held value was in a row that is lost, and when it changed, is not known; a
    simulator that goes on through it has an error from there on.
    """
    lost = (np.flatnonzero(np.diff(table.time_s) > LOST * table.step_s) + 1).tolist()
    whole = _cut(table, lost)
    abrupt = [table[name] for name in names if name in table and (held or not is_smooth(whole, table[name]))]
    return _cut(table, [row for row in lost if any(column[row] != column[row - 1] for column in abrupt)])


def _cut(table: Table, rows: Iterable[int]) -> Table:
    """The table with a new run at each of these rows as well."""
    ends = sorted({*rows, *(end for run in table.runs for end in (run.start, run.stop))})
    runs = [slice(first, last) for first, last in itertools.pairwise(ends)]
    inside = [each for each in runs if any(run.start <= each.start and each.stop <= run.stop for run in table.runs)]
    return dataclasses.replace(table, runs=tuple(inside))


def counts_of(table: Table, name: str) -> float:
    """The step of a channel's values as they were recorded, in its unit; 0 where they are in none."""
    return table.counts[name] if name in table.counts else lattice_step(table[name])


def _inside(table: Table) -> np.ndarray:
    """True for the differences of stamps that lie within a run."""
    inside = np.ones(max(0, len(table) - 1), dtype=bool)
    for run in table.runs[1:]:
        inside[run.start - 1] = False
    return inside


def resting(table: Table, rate: Array, share: float = 0.01, shortest_s: float = 0.2) -> np.ndarray:
    """True while a machine with dry friction rests: its rate stays below `share` of the fastest for `shortest_s`.

    There friction balances any torque up to its limit, and an equation says nothing. A reversal is not a rest.
    """
    slow = np.abs(rate) <= share * float(np.quantile(np.abs(rate), 0.98))
    out = np.zeros(len(slow), dtype=bool)
    for run in table.runs:
        edges = np.flatnonzero(np.diff(np.concatenate(([0], slow[run].astype(int), [0]))))
        for first, last in edges.reshape(-1, 2).tolist():
            if (last - first) * table.step_s >= shortest_s:
                out[run.start + first : run.start + last] = True
    return out


def on_one_count(table: Table, column: Array, rows: int, count: float | None = None) -> np.ndarray:
    """True where a column in counts stays on one of them, or between two, for `rows` rows about each: (n,).

    What it is rounded by is then one error for all of these rows, which noise from row to row does not show. count:
    `counts_of` the channel, the column's own where it is not given.
    """
    step = lattice_step(column) if count is None else count
    if not step > 0.0:
        return np.zeros(len(column), dtype=bool)

    def reach(part: Array) -> Array:
        highest = ndimage.maximum_filter1d(part, rows, mode="nearest")
        return np.asarray(highest - ndimage.minimum_filter1d(part, rows, mode="nearest"))

    return per_run(table, reach, column) < 1.5 * step


def clipped(table: Table, column: Array, count: float | None = None) -> np.ndarray:
    """True where a measured column is cut off at its largest or its smallest value.

    It then arrives there at its usual slope and stays for three samples or more at one number; a machine that rests at
    the end of its way slows down before. In counts it arrives there by a whole count however slow it is, so that it
    must have passed more of them. All False for less than two such stretches, and for few different numbers. count:
    `counts_of` the channel, the column's own where it is not given.
    """
    out = np.zeros(len(column), dtype=bool)
    if len(np.unique(column)) <= FEW_NUMBERS:
        return out
    usual = float(np.sqrt(np.mean(np.diff(column) ** 2)))
    count = lattice_step(column) if count is None else count
    back = max(FLAT, math.ceil(PASSED * count / usual))
    for extreme in (np.max(column), np.min(column)):
        arrivals, found = [], []
        for run in table.runs:
            part = column[run]
            slope = np.abs(np.diff(part))
            edges = np.flatnonzero(np.diff(np.concatenate(([0], (part == extreme).astype(int), [0]))))
            for first, last in edges.reshape(-1, 2).tolist():
                if last - first >= FLAT and first >= back and last < len(part):
                    way = (
                        abs(part[first] - part[first - back]) - count if count else np.sum(slope[first - back : first])
                    )
                    arrivals.append(float(way) / back)
                    found.append(slice(run.start + first, run.start + last))
        if len(found) >= FEWEST_FLATS and float(np.median(arrivals)) > STEEP * usual:
            for each in found:
                out[each] = True
    return out


def near_jumps(table: Table, column: Array) -> np.ndarray:
    """True within two samples of a jump: a change far above the usual one, by a tenth of the whole range at least.

    What lies between two samples is not known there, and a slope over them belongs to neither of its sides.
    """
    out = np.zeros(len(column), dtype=bool)
    change = np.abs(np.diff(column))
    if not len(change):
        return out
    limit = max(JUMP * float(np.ptp(column)), JUMPS_BY * float(np.median(change)))
    for run in table.runs:
        for at in np.flatnonzero(change[run.start : run.stop - 1] > limit).tolist():
            out[max(run.start, run.start + at - 1) : min(run.stop, run.start + at + 3)] = True
    return out


def jumps(table: Table, column: Array) -> Array:
    """(n,) sizes of the jumps in the steps from each row to the next, as `near_jumps` finds them, 0 elsewhere.

    A mean over a sample has a jump in two steps; each of them has the size of both.
    """
    change = np.abs(np.diff(column, append=column[-1:]))
    near = near_jumps(table, column)
    for run in table.runs:
        change[run.stop - 1] = 0.0
    return np.where(near, ndimage.maximum_filter1d(change, 3, mode="constant"), 0.0)


def roughness(table: Table, column: Array, unmeasured: Rows | None = None) -> float:
    """Deviation of a channel's own noise: its departure from a parabola over a tenth of a second, without jumps.

    The window is shorter where the departure grows nearly as fast as it: then it is motion, of a machine that is that
    fast. Noise with a memory grows with the window's root at most, and counts of a slow channel show in long ones only.
    unmeasured: (n,) rows that do not count.
    """
    longest = max(SHORTEST_WINDOW, 2 * round(0.5 * ROUGH_S / table.step_s) + 1)
    sizes = itertools.takewhile(lambda size: size < longest, (SHORTEST_WINDOW * 2**n | 1 for n in itertools.count()))
    counts = lattice_step(column)
    found, before = 0.0, 0
    for size in (*sizes, longest):
        now = _off_parabola(table, column, unmeasured, size)
        if before and found > COUNTED * counts and now > found * (size / before) ** GROWS:
            break
        found, before = now, size
    return found


def _off_parabola(table: Table, column: Array, unmeasured: Rows | None, size: int) -> float:
    """Deviation from a parabola over so many rows; 0 where no run has as many."""
    parts = [savgol_filter(column[run], size, 2) - column[run] for run in table.runs if run.stop - run.start > size]
    if not parts:
        return 0.0
    rest = np.concatenate(parts)
    if unmeasured is not None:
        rest = rest[~np.concatenate([unmeasured[run] for run in table.runs if run.stop - run.start > size])]
    # the parabola uses three of these degrees of freedom
    return float(np.median(np.abs(rest))) / 0.6745 * float(np.sqrt(size / (size - 3.0)))


def stays(table: Table, column: Array) -> bool:
    """True for a channel that stays at a value for several samples and then jumps: its source holds it."""
    return all(
        np.count_nonzero(np.diff(column[run])) < HELD_JUMPS * (run.stop - run.start)
        for run in table.runs
        if run.stop - run.start > 1
    )


def rounding(table: Table, column: Array) -> float:
    """Deviation that white noise would have whose slow part is that of the rounding of a channel that stays at levels.

    A level is rounded once, and the error lasts as long as the level does: 1 / sqrt(12) of a count, times the root of
    the level's rows. `roughness` sees none of it. 0 where the values are not counts of a measurement, which shows by
    some that go to the next count and back: a command on round values has none of these.
    """
    steps = np.concatenate([np.diff(column[run]) for run in table.runs])
    sizes = np.abs(steps)
    count = lattice_step(column)
    of_one = sizes < 1.5 * count
    there_and_back = of_one[1:] & of_one[:-1] & (steps[1:] * steps[:-1] < -0.25 * count**2)
    if np.count_nonzero(there_and_back) < FEWEST_RETURNS:
        return 0.0
    levels = 1 + np.count_nonzero(~of_one)
    return count / math.sqrt(12.0) * math.sqrt(len(column) / levels)


def is_smooth(table: Table, column: Array) -> bool:
    """True where a cubic through every second sample meets the samples between better than straight lines do."""
    straight = cubic = 0.0
    for run in table.runs:
        c = column[run]
        if len(c) < 8:
            continue
        middle, near, far = c[3:-3], 0.5 * (c[2:-4] + c[4:-2]), 0.5 * (c[:-6] + c[6:])
        straight += float(np.sum((middle - near) ** 2))
        cubic += float(np.sum((middle - (9.0 * near - far) / 8.0) ** 2))
    return cubic < SMOOTHER * straight


def averaged(table: Table, count: int) -> Table:
    """The table with every `count` samples of a run averaged into one."""
    if count == 1:
        return table
    runs, start = [], 0
    stamps: list[Array] = []
    columns: dict[str, list[Array]] = {name: [] for name in table.columns}
    unmeasured: dict[str, list[Rows]] = {name: [] for name in table.unmeasured}
    for run in table.runs:
        size = (run.stop - run.start) // count
        if not size:
            continue
        inside = slice(run.start, run.start + size * count)
        stamps.append(table.time_s[inside].reshape(size, count).mean(axis=1))
        for name, column in table.columns.items():
            columns[name].append(column[inside].reshape(size, count).mean(axis=1))
        for name, rows in table.unmeasured.items():
            unmeasured[name].append(np.any(rows[inside].reshape(size, count), axis=1))
        runs.append(slice(start, start + size))
        start += size
    return Table(
        np.concatenate(stamps),
        {name: np.concatenate(parts) for name, parts in columns.items()},
        tuple(runs),
        table.name,
        table.resolution,
        {name: np.concatenate(parts) for name, parts in unmeasured.items()},
        begin_s=table.begin_s,
    )
