"""Channels as the page plots them: their description, a bounded memory for a running robot, and decimation.

A plot has some thousand pixels and an hour of 500 Hz has 1.8 million samples. So time is divided into buckets of equal
width, which begin at whole multiples of it, and the plot shows the lowest and highest value of each: no spike is lost,
and nothing flickers when the window moves on.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

Times = NDArray[np.float64]
Values = NDArray[np.float32]

# Of a running robot: every sample of the last minute, and extremes over these widths (s) for these times (s). Chosen by
# us: a window of an hour has fewer columns of pixels. The 436 channels of Ranger are 105 MB fine and 67 MB in extremes.
FINE_S = 60.0
COARSE_S = ((0.1, 600.0), (1.0, 3600.0))
GAP_PERIODS = 2.5  # this many usual periods without a sample are a gap


@dataclasses.dataclass(frozen=True)
class Channel:
    """One quantity. group: its owner (a board, or the body). states: names of its numbers, if it is a state."""

    name: str
    unit: str
    description: str
    group: str
    states: dict[int, str] = dataclasses.field(default_factory=dict)

    def content(self) -> dict[str, Any]:
        """Its description for the page."""
        return dataclasses.asdict(self)


@dataclasses.dataclass(frozen=True)
class Trace:
    """The plotted points of one channel. x, low, high: (n,), NaN in low and high where there is a gap.

    high is None: low holds the samples themselves.
    """

    x: Times
    low: Values
    high: Values | None


EMPTY = Trace(np.empty(0), np.empty(0, np.float32), None)


def thinned(times: Times, values: Values, begin: float, end: float, points: int, period: float | None) -> Trace:
    """The samples from `begin` to `end` (s) in at most `points` buckets, or unchanged if they are few.

    times (n,), rising; values (n,). period: usual distance of two samples; None: the value holds until the next one.
    """
    first, last = np.searchsorted(times, (begin, end))
    first, last = max(0, int(first) - 1), min(len(times), int(last) + 1)  # lines continue beyond the edge
    times, values = times[first:last], values[first:last]
    if len(times) == 0 or end <= begin or points < 1:
        return EMPTY
    if period is None:
        return _standing(times, values, begin, end, points)
    if len(times) <= 2 * points:
        return _with_gaps(times, values, period)
    width = max((end - begin) / points, period)
    bucket = np.floor(times / width).astype(np.int64)
    starts = np.flatnonzero(np.diff(bucket, prepend=bucket[0] - 1))
    low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
    place = bucket[starts] - bucket[0]
    count = int(place[-1]) + 1
    lows, highs = np.full(count, np.nan, np.float32), np.full(count, np.nan, np.float32)
    lows[place], highs[place] = low, high
    if width < GAP_PERIODS * period:  # a bucket may be empty without a gap
        lows, highs = _bridged(lows, width, period), _bridged(highs, width, period)
    return Trace((bucket[0] + np.arange(count)) * width, lows, highs)


def _bridged(values: Values, width: float, period: float) -> Values:
    """Fill buckets that are empty for less than a gap with the value before them."""
    there = ~np.isnan(values)
    before = np.maximum.accumulate(np.where(there, np.arange(len(values)), 0))
    near = (np.arange(len(values)) - before) * width < GAP_PERIODS * period
    return np.where(there | ~near, values, values[before]).astype(np.float32)


def _with_gaps(times: Times, values: Values, period: float) -> Trace:
    """Every sample, and a NaN point in every gap."""
    gaps = np.flatnonzero(np.diff(times) > GAP_PERIODS * period)
    x = np.insert(times, gaps + 1, times[gaps] + period)
    low = np.insert(values, gaps + 1, np.float32(np.nan))
    return Trace(x, low, None)


def _standing(times: Times, values: Values, begin: float, end: float, points: int) -> Trace:
    """A quantity sampled on change: steps, from the samples around and in the window."""
    if len(times) <= points:
        final = np.append(np.diff(times) > 0, True)  # of several at one time
        times, values = times[final], values[final]
        x = np.repeat(times, 2)[1:]
        x[1::2] = np.nextafter(x[1::2], -np.inf)  # the value before: a plot has one point per time
        low = np.repeat(values, 2)[:-1]
        if times[-1] < end:
            x, low = np.append(x, end), np.append(low, values[-1])
        return Trace(x, low, None)
    width = (end - begin) / points
    edges = np.floor(begin / width) * width + np.arange(points + 2) * width
    at = np.searchsorted(times, edges, side="right")
    before = np.clip(at[:-1] - 1, 0, None)  # the value at the start of the bucket
    starts = np.minimum(at[:-1], len(values) - 1)
    inside = at[1:] > at[:-1]
    low, high = values[before].copy(), values[before].copy()
    if inside.any():
        low[inside] = np.minimum(low[inside], np.minimum.reduceat(values, starts[inside]))
        high[inside] = np.maximum(high[inside], np.maximum.reduceat(values, starts[inside]))
    return Trace(edges[:-1], low, high)


def between(times: Times, values: Values, begin: float, end: float) -> tuple[Times, Values]:
    """The samples from `begin` to `end` (s), both included."""
    first, last = np.searchsorted(times, begin), np.searchsorted(times, end, side="right")
    return times[first:last], values[first:last]


class Memory:
    """The last samples of `columns` quantities that are sampled together, and an hour of their extremes.

    newest: time (s) of the last row, None before the first.
    """

    def __init__(self, columns: int, period_s: float, fine_s: float | None = None) -> None:
        self.columns = columns
        self.period_s = period_s
        self.fine_s = FINE_S if fine_s is None else fine_s
        self.fine = _Rows(columns, round(self.fine_s / period_s))
        self.coarse = [_Extremes(columns, width_s, kept_s) for width_s, kept_s in COARSE_S]
        self.newest: float | None = None

    def append(self, times: Times, values: Values) -> None:
        """Rows: times (n,), rising, later than all before; values (n, columns)."""
        if len(times) == 0:
            return
        if self.newest is not None and times[0] <= self.newest:  # another robot, or it was restarted
            self.__init__(self.columns, self.period_s, self.fine_s)  # type: ignore[misc]
        self.fine.append(times, values)
        self.newest = float(times[-1])
        for extremes in self.coarse:
            extremes.append(times, values)

    def trace(self, column: int, begin: float, end: float, points: int) -> Trace:
        """One column of a window: from the samples if they reach back far enough, else from the narrowest extremes."""
        times, values = self.fine.rows()
        if len(times) == 0:
            return EMPTY
        first = [times[0], *(extremes.first() for extremes in self.coarse)]
        reaches = [0.0, *(extremes.width_s for extremes in self.coarse)]  # a begin earlier by this is not older
        for level, oldest in enumerate(first):
            older = (first[k] < oldest - reaches[k] for k in range(level + 1, len(first)))
            if begin >= oldest or not any(older):
                break
        if level == 0:
            return thinned(times, values[:, column], begin, end, points, self.period_s)
        return self.coarse[level - 1].trace(column, begin, end, points)

    def row(self, at: float) -> tuple[float, Values] | None:
        """(time, values) of the last sample not later than `at`."""
        times, values = self.fine.rows()
        place = int(np.searchsorted(times, at, side="right")) - 1
        return (float(times[place]), values[place]) if place >= 0 else None


class _Extremes:
    """Lowest and highest value of every `width_s`, for the last `kept_s`; the newest is still growing."""

    def __init__(self, columns: int, width_s: float, kept_s: float) -> None:
        self.width_s = width_s
        self.low = _Rows(columns, round(kept_s / width_s))
        self.high = _Rows(columns, round(kept_s / width_s))
        self.bucket = -1  # the newest

    def append(self, times: Times, values: Values) -> None:
        buckets = np.floor(times / self.width_s + 1e-9).astype(np.int64)
        starts = np.flatnonzero(np.diff(buckets, prepend=buckets[0] - 1))
        lows, highs = np.minimum.reduceat(values, starts, axis=0), np.maximum.reduceat(values, starts, axis=0)
        numbers = buckets[starts]
        known = int(numbers[0] == self.bucket)
        if known:
            for rows, found, wider in ((self.low, lows, np.minimum), (self.high, highs, np.maximum)):
                newest = rows.rows()[1][-1]
                wider(newest, found[0], out=newest)
        if len(numbers) > known:
            begin = (numbers[known:] * self.width_s).astype(np.float64)
            self.low.append(begin, lows[known:])
            self.high.append(begin, highs[known:])
            self.bucket = int(numbers[-1])

    def first(self) -> float:
        """The begin of the oldest bucket, s; there must be one."""
        return float(self.low.rows()[0][0])

    def trace(self, column: int, begin: float, end: float, points: int) -> Trace:
        times, lows = self.low.rows()
        low = thinned(times, lows[:, column], begin, end, points, self.width_s)
        high = thinned(times, self.high.rows()[1][:, column], begin, end, points, self.width_s)
        return Trace(low.x, low.low, high.low if high.high is None else high.high)


class _Rows:
    """The last `most` rows, contiguous: a buffer of twice the size, whose newer half moves to the front when full."""

    def __init__(self, columns: int, most: int) -> None:
        self.most = most
        self.times = np.empty(2 * most)
        self.values = np.empty((2 * most, columns), np.float32)
        self.used = 0

    def append(self, times: Times, values: Values) -> None:
        times, values = times[-self.most :], values[-self.most :]
        if self.used + len(times) > len(self.times):
            kept = self.most - len(times)
            if kept > 0:
                self.times[:kept] = self.times[self.used - kept : self.used].copy()
                self.values[:kept] = self.values[self.used - kept : self.used].copy()
            self.used = max(kept, 0)
        end = self.used + len(times)
        self.times[self.used : end] = times
        self.values[self.used : end] = values
        self.used = end

    def rows(self) -> tuple[Times, Values]:
        first = max(0, self.used - self.most)
        return self.times[first : self.used], self.values[first : self.used]
