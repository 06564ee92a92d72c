"""The order of a channel's samples in time: samples that are kept, sorted in between, or impossible to place.

Rows that are merely out of order fit at their stamps: sorted, the samples have the expected distances.
Where a sample was moved and does not fit, its stamp is wrong, or it belongs to another recording.
"""

import bisect
import dataclasses
import functools

import numpy as np
from numpy.typing import NDArray

from ranger_sim.sysid.dataset import Array

ALIKE = 0.5  # of the usual step: steps that differ by no more belong to one sampling
ALIKE_PART = 0.6  # of the steps from row to row: then these are the sampling's, and not those of the sorted stamps
# usual steps to the next sample on either side; two interleaved recordings of one rate are half a step from each other,
# or nearer
NEAREST, FARTHEST = 0.6, 1.5
EVEN = 0.1  # of the usual step, for the evidence that is reported
SHORTEST_RECORDING = 30  # samples without a step back


@dataclasses.dataclass(frozen=True)
class Order:
    """kept: places of the samples in the order of their stamps, none twice; moved: number of sorted samples.

    even: part of the sorted steps that are the usual one, `step_s`, to a tenth. left_out: places by reason
    (dataset.LOSSES and NOTHING_LOST). kept and left_out together are all samples.
    """

    kept: NDArray[np.intp]
    moved: int
    step_s: float
    even: float
    left_out: dict[str, NDArray[np.intp]]


def of(time_s: Array, value: Array) -> Order:
    """The order of samples, each of shape (n,)."""
    finite = np.isfinite(time_s) & np.isfinite(value)
    place = np.flatnonzero(finite)
    stamps = time_s[place]
    steps = np.diff(stamps)
    moved = np.zeros(len(place), dtype=bool)
    usual, restarted = 0.0, False
    if (steps < 0.0).any():
        moved = ~_in_place(stamps.tobytes())
        usual = _usual_step(stamps)
        restarted = _restarts(steps)
        in_order = np.lexsort((moved, stamps))  # of one stamp, samples in place precede moved ones
        place, stamps, moved = place[in_order], stamps[in_order], moved[in_order]
    first = np.concatenate(([True], np.diff(stamps) != 0.0))[: len(stamps)]
    same = ~first & (value[place] == value[place[np.maximum.accumulate(np.where(first, np.arange(len(place)), 0))]])
    around = np.concatenate(([np.inf], np.diff(stamps[first]), [np.inf]))
    near = np.minimum(around[:-1], around[1:])[: int(first.sum())]
    misfit = moved & ~first & ~same
    misfit[first] = moved[first] & ((near < NEAREST * usual) | (near > FARTHEST * usual))
    kept = first & ~misfit
    left_out = {
        "not_finite": np.flatnonzero(~finite),
        "reversed_stamps": place[misfit],
        "repeated": place[same],
        "duplicate_stamps": place[~first & ~same & ~misfit],
    }
    unplaced = np.concatenate((left_out["reversed_stamps"], left_out["duplicate_stamps"]))
    if restarted and len(unplaced) >= SHORTEST_RECORDING:
        del left_out["reversed_stamps"], left_out["duplicate_stamps"]
        left_out["restarted_stamps"] = np.sort(unplaced)
    steps = np.diff(stamps[kept])
    even = float(np.mean(np.abs(steps - usual) <= EVEN * usual)) if len(steps) else 0.0
    left_out = {reason: found for reason, found in left_out.items() if len(found)}
    return Order(place[kept], int(moved[kept].sum()), usual, even, left_out)


@functools.lru_cache(maxsize=2)  # the channels of a table have one time column
def _in_place(stamps: bytes) -> NDArray[np.bool_]:
    """True for the samples that can stay: the largest number whose stamps do not decrease."""
    values = np.frombuffer(stamps, dtype=np.float64).tolist()
    last: list[float] = []  # smallest last stamp of a run of this length
    ends: list[int] = []  # its sample
    before = [-1] * len(values)
    for number, stamp in enumerate(values):
        length = bisect.bisect_right(last, stamp)
        if length == len(last):
            last.append(stamp)
            ends.append(number)
        else:
            last[length], ends[length] = stamp, number
        before[number] = ends[length - 1] if length else -1
    kept = np.zeros(len(values), dtype=bool)
    number = ends[-1] if ends else -1
    while number >= 0:
        kept[number] = True
        number = before[number]
    return kept


def _usual_step(stamps: Array) -> float:
    """The sampling's step: from row to row where most of those steps are alike, else of the sorted stamps."""
    rows = np.abs(np.diff(stamps))
    rows = rows[rows > 0.0]
    usual = float(np.median(rows))
    if np.mean(np.abs(rows - usual) <= ALIKE * usual) >= ALIKE_PART:
        return usual
    steps = np.diff(np.sort(stamps))
    return float(np.median(steps[steps > 0.0]))


def _restarts(steps: Array) -> bool:
    """True when every stretch without a step back is long enough for a separate recording."""
    ends = np.concatenate(([-1], np.flatnonzero(steps < 0.0), [len(steps)]))
    return bool(np.diff(ends).min() >= SHORTEST_RECORDING)
