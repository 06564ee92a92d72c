"""Counters that ran over: of values, and of stamps.

A counter that runs over goes from one end of its range to the other, by its whole span, while the motion goes on. A
voltage that is switched from +5 to -5 V does the same but for the span, which is none that a counter has.
"""

import dataclasses
import math

import numpy as np

from ranger_sim.sysid.dataset import Array

MOST = 0.8  # of a channel's range: a jump of so much may be a counter's
AROUND, FEWEST_AROUND = 5, 3  # steps on either side that show the motion, and so many at least
CALM = 0.2  # of the jump: largest step of the motion around it
STEADY = 0.2  # of the faster motion: the slower one, on the other side of the jump
FEWEST_BITS, MOST_BITS = 8, 64  # of an integer that can run over
FEWEST_OF_ONE_SPAN = 3  # overruns by one span, which is then a counter's, whatever its size
TURN = 1e-6  # of a turn: what a span of whole turns is off by
COUNTED = ("rad", "m", "counts", "s", "")  # units of what goes on and on
SPANS_S = (  # of clocks: 16 to 32 bits of us, 10 us, ms and 10 ms; an hour, a day, a week
    *(2.0**bits * tick for bits in (16, 24, 31, 32) for tick in (1e-6, 1e-5, 1e-3, 1e-2)),
    3600.0,
    86400.0,
    604800.0,
)
CLOCK_ENDS = 50  # usual steps from either end of a clock's range: a radio link may have been silent there
SHORTEST_CLOCK_S = 30.0


@dataclasses.dataclass(frozen=True)
class Wraps:
    """places: samples behind which an integer ran over; span: how far, in the channel's unit. in_turns: an angle's."""

    places: tuple[int, ...] = ()
    span: float = 0.0
    in_turns: bool = False

    @property
    def meaning(self) -> str:
        """In words."""
        return "an angle that begins again after a turn" if self.in_turns else "an integer ran over"


def of(value: Array, unit: str, quanta: tuple[float, ...]) -> Wraps:
    """Where a counter ran over. value: (n,); quanta: the channel's finest steps, as far as known, 0 where not.

    All jumps of most of the range must be overruns by one span, from one end of the range to the other; a channel
    that jumps otherwise too is switched, not counted.
    """
    steps = np.diff(value)
    jumps = np.flatnonzero(np.abs(steps) > MOST * float(np.ptp(value))) if len(value) else np.array([], dtype=int)
    if not len(jumps):
        return Wraps()
    low, high = float(value.min()), float(value.max())
    calm = np.setdiff1d(np.arange(len(steps)), jumps)  # steps of the motion itself
    sizes, reaches, blurs, sure = [], [], [], []
    for place in jumps:
        here = int(np.searchsorted(calm, place))  # a jump is none of the calm steps
        before, after = calm[max(0, here - AROUND) : here], calm[here : here + AROUND]
        near = np.abs(steps[np.concatenate((before, after))])
        reach = float(near.max()) if len(near) else 0.0
        top, bottom = max(value[place : place + 2]), min(value[place : place + 2])
        if high - top > reach or bottom - low > reach:
            return Wraps()
        reaches.append(reach)
        sure.append(_against_motion(steps[place], steps[before], steps[after]))
        motion = (steps[before[-1]], steps[after[0]]) if sure[-1] else (0.0, 0.0)
        sizes.append(abs(float(steps[place] - 0.5 * sum(motion))))
        blurs.append(0.5 * abs(float(motion[0] - motion[1])))
    if not any(sure):
        return Wraps()
    chosen = [size for size, is_sure in zip(sizes, sure, strict=True) if is_sure]
    blur = max(blurs)
    span = _span(chosen, blur, unit, quanta, len({bool(steps[p] > 0.0) for p in jumps}) == 1)
    if span == 0.0 or any(abs(size - span) > 2.0 * reach + blur for size, reach in zip(sizes, reaches, strict=True)):
        return Wraps()
    turns = span / (2.0 * math.pi)
    in_turns = unit == "rad" and turns > 0.5 and abs(turns - round(turns)) < TURN
    return Wraps(tuple(int(place) for place in jumps), span, in_turns)


def _against_motion(jump: float, before: Array, after: Array) -> bool:
    """True when the motion goes on behind the jump as before it, and the jump goes against it. before, after: steps."""
    if min(len(before), len(after)) < FEWEST_AROUND:
        return False
    slopes = float(before.mean()), float(after.mean())
    calm = max(np.abs(before).max(), np.abs(after).max()) < CALM * abs(jump)
    steady = min(map(abs, slopes)) > STEADY * max(map(abs, slopes))
    return bool(calm and steady and slopes[0] * slopes[1] > 0.0 and slopes[0] * jump < 0.0)


def _span(sizes: list[float], blur: float, unit: str, quanta: tuple[float, ...], one_way: bool) -> float:
    """The span of a counter that these jumps, less the motion, are; 0 when they are none that a counter makes."""
    size = float(np.median(sizes))
    quanta = tuple(quantum for quantum in quanta if quantum > 0.0)
    spans = [quantum * 2.0**bits for quantum in quanta for bits in range(FEWEST_BITS, MOST_BITS + 1)]
    if unit == "rad":
        spans.append(2.0 * math.pi * max(1, round(size / (2.0 * math.pi))))
    # the nearest span a counter has: within the motion's own change, and half a count
    span = min(spans, key=lambda each: abs(each - size), default=0.0)
    if spans and abs(span - size) <= blur + 0.5 * min(quanta, default=0.0) + 1e-9 * size:
        return span
    quantum = max(quanta, default=0.0)
    alike = quantum > 0.0 and max(sizes) - min(sizes) <= 2.0 * blur + quantum
    if unit in COUNTED and one_way and alike and len(sizes) >= FEWEST_OF_ONE_SPAN:
        return round(size / quantum) * quantum
    return 0.0


def of_clock(time_s: Array) -> list[tuple[int, float]]:
    """(sample, span in s) of every place behind which the counter of the stamps (n,) ran over."""
    with np.errstate(invalid="ignore"):
        steps = np.diff(time_s)
        forward = steps[steps > 0.0]
        back = np.flatnonzero(steps < 0.0)
        if not len(forward) or not len(back):
            return []
        usual, last = float(np.median(forward)), float(np.nanmax(time_s))
    reach = CLOCK_ENDS * usual
    found = []
    for place in back:
        before, after = float(time_s[place]), float(time_s[place + 1])
        span = min(SPANS_S, key=lambda each: abs(each - before - usual))
        at_the_ends = 0.0 <= after <= reach and -usual <= span - before <= reach
        if at_the_ends and before >= max(last - reach, SHORTEST_CLOCK_S):
            found.append((int(place), span))
    return found


def counted_on(time_s: Array) -> Array:
    """The stamps with the counter's span added behind each place where it ran over."""
    mended = time_s.copy()
    for place, span in of_clock(time_s):
        mended[place + 1 :] += span
    return mended
