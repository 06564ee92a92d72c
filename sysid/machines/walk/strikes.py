"""Times of foot strikes, and the stance foot in between: from contact sensors, or from the jump of the hip's rate."""

import dataclasses

import numpy as np
from scipy import ndimage

from ranger_sim.sysid.dataset import Array, Table

CONTACT_LATE_S = 0.013  # delay of a board's strike report: 5.5 ms of counting (robot.md N4.9), the rest the sole's rise
SHORTEST_STEP_S, LONGEST_STEP_S = 0.25, 1.2  # others are not steps of a walk
LEAST_SPLIT_RAD = 0.15  # between the legs at a strike
SMOOTH_S = 0.006  # of the rate in which a jump is sought where there is no contact sensor


@dataclasses.dataclass(frozen=True)
class Strike:
    """time_s of the touch; leg that touched: 0 outer, 1 inner; run: number of the table's run."""

    time_s: float
    leg: int
    run: int


def find(table: Table) -> list[Strike]:
    """All strikes of a recording that has the hip's angle, in order."""
    found: list[Strike] = []
    for number, run in enumerate(table.runs):
        time_s, hip = table.time_s[run], table["hip_angle_rad"][run]
        if len(time_s) < 20:
            continue
        touches = _by_contact(table, run) if by_contact(table) else _by_hip(time_s, hip, table.step_s)
        found += [Strike(touch_s, leg, number) for touch_s, leg in touches]
    return found


def by_contact(table: Table) -> bool:
    """True when both pairs of feet have a contact sensor."""
    return "outer_contact" in table and "inner_contact" in table


def standing(table: Table, strikes: list[Strike], after_s: float, before_s: float) -> tuple[np.ndarray, np.ndarray]:
    """(stance leg, -1: unknown; True in single stance, outside these times after and before strikes), both (n,)."""
    stands = np.full(len(table), -1)
    single = np.zeros(len(table), dtype=bool)
    for one, other in zip(strikes[:-1], strikes[1:], strict=True):
        step_s = other.time_s - one.time_s
        if one.run != other.run or one.leg == other.leg or not SHORTEST_STEP_S < step_s < LONGEST_STEP_S:
            continue
        between = (table.time_s >= one.time_s) & (table.time_s < other.time_s)
        stands[between] = one.leg
        single |= (table.time_s > one.time_s + after_s) & (table.time_s < other.time_s - before_s)
    return stands, single


def places(table: Table, strikes: list[Strike], stands: np.ndarray, after_s: float, every_s: float) -> np.ndarray:
    """(n,) number of a leg and a time after a strike, for one row every interval after that time; -1 elsewhere.

    Rows of one number are repeats: the same place in the strides.
    """
    out = np.full(len(table), -1)
    wait, every = round(after_s / table.step_s), round(every_s / table.step_s)
    for number, strike in enumerate(strikes):
        run = table.runs[strike.run]
        ends_s = strikes[number + 1].time_s if number + 1 < len(strikes) else np.inf
        first = run.start + int(np.searchsorted(table.time_s[run], strike.time_s - 1e-9))
        rows = np.arange(first + wait, run.stop, every)
        rows = rows[(stands[rows] == strike.leg) & (table.time_s[rows] < ends_s)]
        out[rows] = 2 * ((rows - first - wait) // every) + strike.leg
    return out


def _by_contact(table: Table, run: slice) -> list[tuple[float, int]]:
    """(time, leg) of each first contact by a sensor while the legs are split."""
    found = []
    for leg, name in enumerate(("outer_contact", "inner_contact")):
        on = table[name][run] > 0.5
        for place in np.flatnonzero(on[1:] & ~on[:-1]) + 1:
            hip = table["hip_angle_rad"][run][place]
            ahead = hip < -LEAST_SPLIT_RAD if leg == 0 else hip > LEAST_SPLIT_RAD
            if ahead:
                found.append((float(table.time_s[run][place]) - CONTACT_LATE_S, leg))
    return sorted(found)


def _by_hip(time_s: Array, hip: Array, step_s: float) -> list[tuple[float, int]]:
    """(time, leg) of the sharpest jump of the hip's rate in each half swing; its sign gives the leading foot."""
    rate = np.gradient(ndimage.gaussian_filter1d(hip, SMOOTH_S / step_s), step_s)
    reach = max(1, round(0.012 / step_s))
    jump = np.zeros_like(rate)
    jump[reach:-reach] = np.abs(rate[2 * reach :] - rate[: -2 * reach])
    found = []
    edges = [0, *(np.flatnonzero(np.diff(np.sign(hip)) != 0) + 1), len(hip)]
    for start, stop in zip(edges[:-1], edges[1:], strict=True):
        top = float(np.max(np.abs(hip[start:stop]), initial=0.0))
        if top < LEAST_SPLIT_RAD:
            continue
        rows = start + np.flatnonzero(np.abs(hip[start:stop]) > 0.6 * top)
        place = int(rows[np.argmax(jump[rows])])
        found.append((float(time_s[place]), 1 if hip[place] > 0.0 else 0))
    return found
