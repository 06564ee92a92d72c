"""Strides of a walk of the controller of 2015 and their features, from a log or from the emulator.

A stride goes from the beginning of inner swing to the next one, through four states of the walk machine (robot.md C6.3
C): inner swing, outer push, outer swing, inner push. Its features are the four durations and the angles at the four
changes of state. The outer leg's lean where a push begins is not a feature: there the machine itself sets it.
"""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ranger_sim.foundation.user_error import UserError

if TYPE_CHECKING:
    from ranger_sim.sysid.dataset import Array, Dataset

INNER_SWING, OUTER_PUSH, OUTER_SWING, INNER_PUSH = 1, 2, 3, 4  # of the walk machine, as logged
ORDER = (INNER_SWING, OUTER_PUSH, OUTER_SWING, INNER_PUSH, INNER_SWING)
STATE_NAMES = {
    INNER_SWING: "inner swing",
    OUTER_PUSH: "outer push",
    OUTER_SWING: "outer swing",
    INNER_PUSH: "inner push",
}
CHANNELS = ("hip_angle_rad", "outer_leg_angle_rad", "walk_state")
POINTS = 25  # of a state, for the comparison of trajectories; a state lasts 0.2 to 0.4 s
ALIKE = 0.15  # strides whose durations differ by less are of one gait (chosen by us: the limp is 8 %)


@dataclasses.dataclass(frozen=True)
class Feature:
    """One number of a stride: name, unit, meaning."""

    name: str
    unit: str
    meaning: str


FEATURES = (
    Feature("inner_swing_s", "s", "inner swing lasts"),
    Feature("outer_push_s", "s", "outer push lasts"),
    Feature("outer_swing_s", "s", "outer swing lasts"),
    Feature("inner_push_s", "s", "inner push lasts"),
    Feature("hip_at_outer_push_rad", "rad", "hip angle where the outer push begins"),
    Feature("hip_at_inner_strike_rad", "rad", "hip angle at the inner feet's touchdown"),
    Feature("hip_at_inner_push_rad", "rad", "hip angle where the inner push begins"),
    Feature("hip_at_outer_strike_rad", "rad", "hip angle at the outer feet's touchdown"),
    Feature("outer_lean_at_inner_strike_rad", "rad", "lean of the outer (rear) leg at the inner feet's touchdown"),
    Feature("outer_lean_at_outer_strike_rad", "rad", "lean of the outer (front) leg at the outer feet's touchdown"),
)


@dataclasses.dataclass(frozen=True)
class Stride:
    """One stride: number in its walk from 1, stamps of its five changes of state, features (10,) as in FEATURES.

    hip_rad, lean_rad: (4 POINTS,), each state's time stretched to the same length. time_s, raw_hip_rad, raw_lean_rad:
    as sampled, from its beginning.
    """

    number: int
    changes_s: tuple[float, ...]
    features: Array
    hip_rad: Array
    lean_rad: Array
    time_s: Array
    raw_hip_rad: Array
    raw_lean_rad: Array

    @property
    def duration_s(self) -> float:
        return self.changes_s[-1] - self.changes_s[0]


@dataclasses.dataclass(frozen=True)
class Walk:
    """A walk's signals, all (n,) with their own stamps: hip angle, outer leg's lean, state.

    ended: why it fell. masked_s: stamps (m,) of values of the hip and of the lean that are left out because they are
    cut off: nothing is interpolated there.
    """

    hip: tuple[Array, Array]
    lean: tuple[Array, Array]
    state: tuple[Array, Array]
    ended: str = ""
    masked_s: tuple[Array, Array] = (np.empty(0), np.empty(0))

    def is_masked(self, begin: float, end: float) -> bool:
        """True when a masked value lies between the samples by which the angles from begin to end are interpolated."""
        for (time_s, _), masked_s in zip((self.hip, self.lean), self.masked_s, strict=True):
            first = time_s[max(0, int(np.searchsorted(time_s, begin, side="right")) - 1)]
            last = time_s[min(len(time_s) - 1, int(np.searchsorted(time_s, end)))]
            if ((masked_s > first) & (masked_s < last)).any():
                return True
        return False

    def strides(self) -> list[Stride]:
        """Every whole stride, without those that a state out of order interrupts, and those with masked values."""
        times, states = self.state
        changes = np.flatnonzero(np.diff(states)) + 1
        order = [int(each) for each in states[changes]]
        found: list[Stride] = []
        number = 0
        for i in range(len(changes) - len(ORDER) + 1):
            if tuple(order[i : i + len(ORDER)]) == ORDER:
                stamps = tuple(float(each) for each in times[changes[i : i + len(ORDER)]])
                number += 1
                if not self.is_masked(stamps[0], stamps[-1]):
                    found.append(self._stride(number, stamps))
        return found

    def _stride(self, number: int, changes_s: tuple[float, ...]) -> Stride:
        at = np.array(changes_s)
        hip = np.interp(at, *self.hip)
        lean = np.interp(at, *self.lean)
        features = np.array([*np.diff(at), *hip[1:], lean[2], lean[4]])
        even = np.concatenate([np.linspace(a, b, POINTS, endpoint=False) for a, b in zip(at[:-1], at[1:], strict=True)])
        inside = (self.hip[0] >= at[0]) & (self.hip[0] <= at[-1])
        own = self.hip[0][inside]
        return Stride(
            number,
            changes_s,
            features,
            np.interp(even, *self.hip),
            np.interp(even, *self.lean),
            own - at[0],
            self.hip[1][inside],
            np.interp(own, *self.lean),
        )


def of_dataset(dataset: Dataset) -> Walk:
    """The walk in a recording whose channels have the experiment's names. UserError when one is missing or no walk."""
    for name in CHANNELS:
        dataset[name]
    states = dataset["walk_state"]
    if not np.all(np.isfinite(states.value)) or np.any(states.value != np.round(states.value)):
        raise UserError(f"{dataset.name}: walk_state has values that are not whole numbers, states 0 to 5 are expected")
    hip, lean = dataset["hip_angle_rad"], dataset["outer_leg_angle_rad"]
    sound = [np.isfinite(each.value) for each in (hip, lean)]
    return Walk(
        (hip.time_s[sound[0]], hip.value[sound[0]]),
        (lean.time_s[sound[1]], lean.value[sound[1]]),
        (states.time_s, states.value),
        masked_s=(hip.masked_s, lean.masked_s),
    )


def of_robot(robot: Any) -> Walk:
    """The walk of an emulated robot with a full log, as its main brain saw it."""
    from ranger_sim.datatable.generated import all_variables

    recorded = robot.recorded()
    time_s = (recorded.word_times_ns - robot.start_ns) * 1e-9

    def column(name: str, kind: type) -> Array:
        words = recorded.words[:, all_variables.ID_OF[name]].astype(np.uint32)
        return np.asarray(words.view(kind), dtype=float)

    return Walk(
        (time_s, column("MCH_ANGLE", np.float32)),
        (time_s, column("E_LO_ANGLE", np.float32)),
        (time_s, column("FSM_LEG", np.int32)),
        robot.ended,
    )


def steady(strides: list[Stride]) -> list[Stride]:
    """The longest run of strides that are of one gait; the earliest of the longest ones."""
    best: list[Stride] = []
    for i in range(len(strides)):
        run = [strides[i]]
        for each in strides[i + 1 :]:
            if each.number != run[-1].number + 1:
                break
            lengths = [stride.duration_s for stride in (*run, each)]
            if max(lengths) > (1.0 + ALIKE) * min(lengths):
                break
            run.append(each)
        if len(run) > len(best):
            best = run
    return best


def scatter(strides: list[Stride]) -> tuple[Array, int]:
    """(standard deviation of each feature in one stride (10,), degrees of freedom behind each).

    Pooled over the features of one unit, because a handful of strides gives a single feature no scatter worth its
    name. UserError with fewer than two strides.
    """
    if len(strides) < 2:
        raise UserError(f"{len(strides)} steady stride: a scatter needs at least 2")
    values = np.array([each.features for each in strides])
    variance = values.var(axis=0, ddof=1)
    found = np.empty(len(FEATURES))
    degrees = []
    for unit in ("s", "rad"):
        own = np.array([feature.unit == unit for feature in FEATURES])
        found[own] = math.sqrt(variance[own].mean())
        degrees.append(int(own.sum()) * (len(strides) - 1))
    return found, min(degrees)
