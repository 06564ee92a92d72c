"""Stamps of a regular clock that were rounded, or written in blocks, and the clock that explains them.

A logger that rounds its stamps to ms or s, or that stamps a whole block of samples at once, has sampled evenly all the
same. `of` finds the even clock whose stamps are nowhere farther from the written ones than their rounding; its residual
says how well it fits. The stamps are changed only on request (`--assume clock=even`).
"""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from ranger_sim.sysid.dataset import Array

FEWEST = 60  # samples
GAP_STEPS = 5.0  # as sanity.GAP_STEPS; the clock is the same on both sides of a gap, and counts anew behind it
SAME_PART = 0.2  # of the stamps come twice: a block or a coarse rounding
ROUND_STEPS_S = tuple(digit * 10.0**power for power in range(1, -7, -1) for digit in (5, 2, 1))
ROUNDED, EXACT_S = 0.02, 2e-6  # of a rounding step, and s: largest distance of a rounded stamp from its multiples
SLACK = 1.05  # of the rounding: the fit is by least squares, not by the smallest largest residual
CHANGED = 0.01  # of the step
FINER = 0.7  # of a step: rounding that is not finer would be rows that are missing
EVEN = 1e-6  # of the step: a clock that is even as it was written


@dataclasses.dataclass(frozen=True)
class EvenClock:
    """step_s: of the even clock; rounding_s: of the written stamps; residual_s: rms of written less even stamps.

    time_s: (n,) even stamps; samples_per_stamp: 1 where no stamp comes twice; in_blocks: the written stamps are
    multiples of no round step.
    """

    step_s: float
    rounding_s: float
    residual_s: float
    time_s: Array
    samples_per_stamp: float
    in_blocks: bool = False

    @property
    def text(self) -> str:
        """The evidence in words."""
        what = f"rounded to {self.rounding_s:.4g} s"
        if self.in_blocks:
            what = f"written in blocks of {self.samples_per_stamp:.3g} samples, {self.rounding_s:.4g} s apart"
        return f"stamps are {what}: an even clock of {self.step_s:.6g} s fits them"


def rounding(time_s: Array) -> float:
    """The round step, in s, of which all stamps (n,) are multiples; 0 where there is none."""
    from_begin, steps = time_s - time_s[0], np.diff(time_s)
    least = float(steps[steps > 0.0].min(initial=np.inf)) * (1.0 + ROUNDED)
    multiples = (each for each in ROUND_STEPS_S if each <= least)
    return next((each for each in multiples if _are_multiples(from_begin, each)), 0.0)


def _are_multiples(stamps: Array, of: float) -> bool:
    return bool(np.abs(stamps - of * np.round(stamps / of)).max() < min(ROUNDED * of, EXACT_S))


def of(time_s: Array) -> EvenClock | None:
    """The even clock behind written stamps (n,); None where they are even already, go back, or none fits."""
    steps = np.diff(time_s)
    if len(time_s) < FEWEST or not np.isfinite(time_s).all() or (steps < 0.0).any() or not steps.any():
        return None
    moved = steps[steps > 0.0]
    usual = float(np.median(moved))
    same = float(np.mean(steps == 0.0))
    if same < SAME_PART and np.abs(moved - usual).max() <= EVEN * usual:
        return None
    round_s = rounding(time_s)
    if not round_s and same < SAME_PART:
        return None
    begins = np.concatenate(([0], np.flatnonzero(steps > GAP_STEPS * usual) + 1, [len(time_s)]))
    counts, middles = np.arange(len(time_s), dtype=float), np.zeros(len(time_s))
    # samples of one stamp are one point, at their middle: the slope through a stair's steps is not tilted by its ends
    first = np.concatenate(([True], steps > 0.0))
    of_stamp = np.cumsum(first) - 1
    points = np.bincount(of_stamp, counts) / np.bincount(of_stamp)
    for begin, end in zip(begins[:-1], begins[1:], strict=True):  # each stretch without a gap about its middle
        inside = slice(of_stamp[begin], of_stamp[end - 1] + 1)
        counts[begin:end] -= points[inside].mean()
        middles[begin:end] = time_s[begin:end][first[begin:end]].mean()
        points[inside] -= points[inside].mean()
    step = float(points @ (time_s - middles)[first] / (points @ points)) if points.any() else 0.0
    even = middles + step * counts
    residual = time_s - even
    # as coarse as the stamps are: a block is as long as most of its like, a rounded stamp is one of its multiples
    blocks = float(np.percentile(moved, 90.0)) if same >= SAME_PART else 0.0
    coarse = max(round_s, blocks)
    if not step > 0.0 or np.ptp(residual) > SLACK * coarse or np.abs(residual).max() <= EVEN * step:
        return None
    if not blocks and round_s > FINER * step:
        return None  # rows that are missing look alike
    per_stamp = len(time_s) / (1.0 + len(moved))
    rms = float(np.sqrt(np.mean(residual**2)))
    return EvenClock(step, coarse, rms, even, per_stamp, in_blocks=blocks > 2.0 * round_s)


def changed(time_s: Array, clock: EvenClock) -> NDArray[np.bool_]:
    """(n,) True for the stamps that an even clock changes."""
    return np.abs(time_s - clock.time_s) > CHANGED * clock.step_s
