"""What a sound robot's step is, given the state at its start: linear and square in that state, by the leg that
swings."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.twins.features import NAMES
from ranger_sim.sysid.twins.steps import INNER, OUTER

VOLTAGE, FOOTHOLD = "battery voltage median", "foothold end"
# Of the step before: they are the state in which this one starts.
START = (
    "hip angle end", "hip rate end", "stance leg angle after", "stance leg rate after", "lean correction after",
    "outer ankle angle end", "inner ankle angle end", "outer leg angle end", "inner leg angle end", "gyro end",
    FOOTHOLD, "way gain", "step time", "hip twist mean", "outer stretch mean", "inner stretch mean",
)  # fmt: skip
FEW_START = ("hip angle end", "hip angle mid", "outer leg angle end", "step time")
FEW = ("step time", "hip angle early", "hip angle end", "hip angle mid", "hip angle top", "outer leg angle end",
       *(f"leg state {n}" for n in range(6)))  # fmt: skip
SQUARES = 6  # of the first start values
REACH = 4.0  # standard deviations of a start beyond which the map is held
OUTSIDE = 6.0  # beyond which a step is not judged
OF_FOOTHOLD = 3  # inputs, the last ones
NEIGHBOURS = 5  # steps on either side of one outside the map, of which
STRAY = 0.5  # at most so many are outside as well when it is left out: more are another gait
RIDGE = 1e-3  # of the rows
WILD = 100.0  # deviations at which what is left is cut


def starts(few: bool) -> tuple[str, ...]:
    """The names of the start values."""
    return FEW_START if few else START


def outcomes(few: bool) -> tuple[str, ...]:
    """The names of what a step is judged by."""
    return FEW if few else tuple(name for name in NAMES if name != VOLTAGE)


def columns(names: Sequence[str]) -> list[int]:
    """Their columns among the features."""
    return [NAMES.index(name) for name in names]


@dataclasses.dataclass(frozen=True)
class LegMap:
    """Of the steps of one leg. start, reach: mean and deviation of the start values (s,); foothold: mean and deviation
    of the height; weights: (x, p); deviation: of what is left (p,)."""

    start: Array
    reach: Array
    foothold: Array
    weights: Array
    deviation: Array


def learn(starts_: Array, footholds: Array | None, found: Array) -> LegMap:
    """The map of one leg by (n, s) starts, (n,) footholds and (n, p) outcomes of sound twins."""
    start, reach = starts_.mean(0), starts_.std(0) + 1e-9
    foothold = np.array([0.0, 0.0]) if footholds is None else np.array([footholds.mean(), footholds.std() + 1e-9])
    empty = LegMap(start, reach, foothold, np.zeros((1, 1)), np.ones(1))
    x = _inputs(empty, starts_, footholds)
    penalty = RIDGE * len(x) * np.eye(x.shape[1])
    penalty[0, 0] = 0.0
    weights = np.linalg.solve(x.T @ x + penalty, x.T @ found)
    if footholds is not None:  # the height itself follows from the start alone: what is left of it is the floor's
        column = outcomes(few=False).index(FOOTHOLD)
        weights[:, column] = 0.0
        bare = slice(0, x.shape[1] - OF_FOOTHOLD)
        weights[bare, column] = np.linalg.solve((x.T @ x + penalty)[bare, bare], x[:, bare].T @ found[:, column])
    left = found - x @ weights
    deviation = 1.4826 * np.median(np.abs(left - np.median(left, 0)), 0)
    deviation = np.maximum(deviation, 0.3 * left.std(0)) + 1e-9
    return LegMap(start, reach, foothold, np.asarray(weights, dtype=np.float64), np.asarray(deviation))


def _inputs(leg: LegMap, starts_: Array, footholds: Array | None) -> Array:
    z = np.clip((starts_ - leg.start) / leg.reach, -REACH, REACH)
    parts = [np.ones((len(z), 1)), z, z[:, :SQUARES] ** 2]
    if footholds is not None:
        height = np.clip((footholds - leg.foothold[0]) / leg.foothold[1], -REACH, REACH)[:, None]
        parts += [height, height * z[:, :2]]
    return np.hstack(parts)


@dataclasses.dataclass(frozen=True)
class Rest:
    """What a sound robot's map leaves of a walk, in its deviations. step: (m,) numbers of the steps; leg: (m,);
    left: (m, p), not a number where a feature is missing; inside: (m,) True where the map is known."""

    step: np.ndarray
    leg: np.ndarray
    left: Array
    inside: np.ndarray


def rest(legs: Sequence[LegMap], leg: np.ndarray, found: Array, few: bool, usable: np.ndarray | None = None) -> Rest:
    """What is left of each step but the first. leg: (k,); found: (k, all features); usable: (k,) steps that count."""
    names = starts(few)
    before = np.hstack((found[:-1][:, columns(names)], found[1:][:, columns([] if few else [VOLTAGE])]))
    after = found[1:][:, columns(outcomes(few))]
    footholds = None if few else found[1:, NAMES.index(FOOTHOLD)]
    left = np.full(after.shape, np.nan)
    inside, counted = np.zeros(len(after), dtype=bool), np.zeros(len(after), dtype=bool)
    for side in (OUTER, INNER):
        rows = (leg[1:] == side) & np.all(np.isfinite(before), axis=1)
        if footholds is not None:
            rows &= np.isfinite(footholds)
        if not rows.any():
            continue
        height = None if footholds is None else footholds[rows]
        x = _inputs(legs[side], before[rows], height)
        left[rows] = np.clip((after[rows] - x @ legs[side].weights) / legs[side].deviation, -WILD, WILD)
        far = np.abs((before[rows] - legs[side].start) / legs[side].reach).max(1)
        inside[rows], counted[rows] = far < OUTSIDE, True
    if usable is not None:
        inside &= usable[1:] & usable[:-1]
        counted &= usable[1:] & usable[:-1]
    return Rest(np.arange(1, len(leg)), leg[1:], left, inside | _another_gait(inside, counted))


def _another_gait(inside: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Steps outside the map among others outside: another gait, from some step on or all the time.
    At the map's edge they still show what is wrong; a stray step is left out."""
    window = np.ones(2 * NEIGHBOURS + 1)
    outside, there = (
        np.convolve(np.pad(rows.astype(float), NEIGHBOURS), window, "valid") for rows in (counted & ~inside, counted)
    )
    return np.asarray(counted & (outside > STRAY * there))
