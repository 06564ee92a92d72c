"""The wrong numbers that explain the differences between emulated and logged walk, as far as a few strides allow.

The settled gait of the emulator is a point f(x) in the space of the stride's features, x the candidates' values. Its
slopes come from emulated walks one step to either side. Causes are added one at a time: the slopes select the most
promising candidates, the best of them are fitted by walking (Gauss-Newton with the steps held inside the limits), and
the best fit stays if an F test accepts it at `LEVEL` over the number of candidates and the held-out strides agree. The
test compares the gain with the model's misfit, not with the strides' scatter alone: the model may have many errors.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import lsq_linear
from scipy.stats import f as f_distribution
from scipy.stats import t as t_distribution

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Array
from studies.compare_walk import gait
from studies.compare_walk.candidates import CANDIDATES, Candidate
from studies.compare_walk.emulate import Emulator

LEVEL = 0.01  # of a false name, over all candidates together
MOST_CAUSES = 3  # ten features support no more with useful intervals
TRIED = 3  # promising candidates that are fitted by walking, in each round
ITERATIONS = 4
TIE = 0.95  # |cos| of two signatures from which on they are one (facts of the diagnosis: docs/diagnose.md)
Values = dict[str, float]


@dataclasses.dataclass(frozen=True)
class Target:
    """Target features (10,), their standard deviations, and the strides of which they are the means."""

    mean: Array
    deviation: Array
    strides: tuple[int, ...]

    @classmethod
    def of(cls, strides: Sequence[gait.Stride], scatter: Array) -> Target:
        mean = np.mean([each.features for each in strides], axis=0)
        return cls(mean, scatter / math.sqrt(len(strides)), tuple(each.number for each in strides))

    def misses(self, features: Array) -> Array:
        """Misses of the features, in standard deviations."""
        return (self.mean - features) / self.deviation


@dataclasses.dataclass
class Fit:
    """Values of the chosen causes, the features there, their misses, slopes (10, k) of the misses."""

    values: Values
    features: Array
    misses: Array
    slopes: Array

    @property
    def misfit(self) -> float:
        return float(self.misses @ self.misses)


@dataclasses.dataclass(frozen=True)
class Cause:
    """A named cause: its value, 95 % interval, and the candidates with an indistinguishable signature."""

    candidate: Candidate
    value: float
    ci95: tuple[float, float]
    tied_with: tuple[str, ...]


@dataclasses.dataclass
class Answer:
    """The whole result. rounds: the tries of each round. physical: the rest is no more than the scatter."""

    base: Fit
    extended: Fit
    causes: list[Cause]
    rounds: list[dict]
    stopped: str
    physical: bool


class Search:
    """Fits candidates to a target by walking.

    progress(text) is called before every walk; degrees: of freedom behind the strides' scatter.
    """

    def __init__(
        self,
        emulator: Emulator,
        fitted: Target,
        held_out: Target,
        candidates: Sequence[Candidate] = CANDIDATES,
        progress: Callable[[str], None] = lambda text: None,
        degrees: int = 4,
    ) -> None:
        self.emulator = emulator
        self.fitted = fitted
        self.held_out = held_out
        self.candidates = candidates
        self.progress = progress
        self.degrees = degrees
        self.known: dict[tuple, Array | None] = {}

    def features(self, values: Values) -> Array | None:
        """Features of the settled gait; None where the robot falls, stops, or is impossible."""
        key = tuple(sorted((name, round(value, 9)) for name, value in values.items() if value != 0.0))
        if key not in self.known:
            self.progress(", ".join(f"{name} {value:+.3g}" for name, value in key) or "unchanged")
            try:
                strides = self.emulator.settled_strides(values)
            except UserError:  # a value that a body or a controller cannot have
                strides = []
            self.known[key] = np.mean([each.features for each in strides], axis=0) if strides else None
        return self.known[key]

    def slope(self, values: Values, candidate: Candidate) -> Array | None:
        """Change of the misses per unit of the candidate, by a step to either side, or to the side that walks."""
        here = values.get(candidate.name, 0.0)
        ends = []
        for side in (-1.0, 1.0):
            place = here + side * candidate.step
            if abs(place) <= candidate.limit:
                ends.append((place, self.features({**values, candidate.name: place})))
        walked = [(place, features) for place, features in ends if features is not None]
        if len(walked) < 2:
            middle = self.features(values)
            if middle is None or not walked:
                return None
            walked.append((here, middle))
        (low, first), (high, second) = walked[:2]
        return np.asarray((second - first) / (high - low) / -self.fitted.deviation)

    def fit(self, start: Values, names: Sequence[str]) -> Fit | None:
        """The named candidates at their best, from `start`."""
        chosen = [each for each in self.candidates if each.name in names]
        values = {each.name: start.get(each.name, 0.0) for each in chosen}
        features = self.features(values)
        if features is None:
            return None
        best = Fit(values, features, self.fitted.misses(features), np.empty((len(features), 0)))
        for _ in range(ITERATIONS if chosen else 0):
            columns = [column for each in chosen if (column := self.slope(best.values, each)) is not None]
            if len(columns) < len(chosen):
                return None
            best.slopes = np.column_stack(columns)
            move = solve(best, chosen)
            better = self._along(best, chosen, move)
            if better is None:
                break
            gained = best.misfit - better.misfit
            better.slopes = best.slopes
            best = better
            if gained < 0.02 * best.misfit:
                break
        return best

    def _along(self, best: Fit, chosen: Sequence[Candidate], move: Array) -> Fit | None:
        """The first improvement among a whole, a half and a quarter of the move."""
        for share in (1.0, 0.5, 0.25):
            values = {
                each.name: best.values[each.name] + share * float(d) for each, d in zip(chosen, move, strict=True)
            }
            features = self.features(values)
            if features is None:
                continue
            misses = self.fitted.misses(features)
            if misses @ misses < best.misfit:
                return Fit(values, features, misses, best.slopes)
        return None

    def run(self) -> Answer:
        """The whole search. The unchanged robot has to walk.

        A candidate that fails the test alone is kept for one more round: two causes of equal size hide each other, and
        both together may pass where the first alone, with the effect of the second unexplained, did not.
        """
        base = self.fit({}, ())
        assert base is not None  # requested earlier
        accepted, trial, rounds = base, base, []
        stopped = f"{MOST_CAUSES} causes are as many as these features carry"
        while len(trial.values) < MOST_CAUSES:
            slopes = {each.name: self.slope(trial.values, each) for each in self.candidates}
            tried = self._round(trial, slopes)
            if not tried:
                stopped = "no further candidate walks"
                break
            name, found = min(tried, key=lambda each: each[1].misfit)
            judged = self.judge(accepted, found)
            rounds.append({"tried": {each: fit.misfit for each, fit in tried}, "best": name, **judged})
            if judged["accepted"]:
                accepted = trial = found
                continue
            if len(found.values) - len(accepted.values) == 2 or not judged["held_out_agrees"]:
                break
            trial = found
        if rounds and not rounds[-1]["accepted"]:
            stopped = why_not([each for each in rounds if not each["accepted"]][-2:])
        return self._answer(base, self.needed(accepted), rounds, stopped)

    def needed(self, fit: Fit) -> Fit:
        """The fit without superfluous causes: of two that passed together one may contribute nothing."""
        for name in list(fit.values):
            fewer = self.fit(fit.values, [each for each in fit.values if each != name])
            if fewer is not None and self.judge(fewer, fit)["p"] >= LEVEL / len(self.candidates):
                return self.needed(fewer)
        return fit

    def judge(self, best: Fit, found: Fit) -> dict:
        """Whether the causes that `found` has more than `best` are named: F test and held-out strides."""
        more = len(found.values) - len(best.values)
        left = len(found.misses) - len(found.values)
        # never compared with less than the strides' scatter
        ratio = (best.misfit - found.misfit) / more / max(1.0, found.misfit / left)
        p = float(f_distribution.sf(ratio, more, left))
        needed = LEVEL / math.comb(max(more, len(self.candidates)), more)
        before, after = self.held_out.misses(best.features), self.held_out.misses(found.features)
        agrees = bool(after @ after < before @ before)
        return {
            "values": dict(found.values),
            "misfit_before": best.misfit,
            "misfit_after": found.misfit,
            "p": p,
            "needed": needed,
            "held_out_before": float(before @ before),
            "held_out_after": float(after @ after),
            "held_out_agrees": agrees,
            "accepted": p < needed and agrees,
        }

    def _round(self, best: Fit, slopes: dict[str, Array | None]) -> list[tuple[str, Fit]]:
        """The most promising candidates, fitted together with the present causes."""
        promises = []
        there = [slopes[name] for name in best.values]
        for each in self.candidates:
            own = slopes[each.name]
            if each.name in best.values or own is None or any(column is None for column in there):
                continue
            columns = np.column_stack([*(column for column in there if column is not None), own])
            chosen = [*(other for other in self.candidates if other.name in best.values), each]
            fit = Fit({c.name: best.values.get(c.name, 0.0) for c in chosen}, best.features, best.misses, columns)
            move = solve(fit, chosen)
            left = best.misses + columns @ move
            promises.append((float(left @ left), each.name))
        tried = []
        for _, name in sorted(promises)[:TRIED]:
            found = self.fit(best.values, [*best.values, name])
            if found is not None:
                tried.append((name, found))
        return tried

    def _answer(self, base: Fit, best: Fit, rounds: list[dict], stopped: str) -> Answer:
        slopes = {each.name: self.slope(best.values, each) for each in self.candidates}
        left = len(best.misses) - len(best.values)
        excess = max(1.0, best.misfit / left)
        causes = []
        if best.values:
            columns = best.slopes
            spread = np.sqrt(excess * np.diag(np.linalg.pinv(columns.T @ columns)))
            reach = float(t_distribution.ppf(0.975, left)) * spread
            for i, (name, value) in enumerate(best.values.items()):
                candidate = next(each for each in self.candidates if each.name == name)
                ties = tied(name, columns[:, i], np.delete(columns, i, axis=1), slopes)
                causes.append(Cause(candidate, value, (value - float(reach[i]), value + float(reach[i])), ties))
        # misses of a good model: chi squared with the scatter's few degrees of freedom, an F distribution
        physical = bool(best.misfit / left < f_distribution.ppf(0.95, left, self.degrees))
        return Answer(base, best, causes, rounds, stopped, physical)


def why_not(refused: Sequence[dict]) -> str:
    """A sentence on the refused rounds: the first one's candidate alone, the second one's with it."""
    first = refused[0]
    numbers = (
        f"squared misses from {first['misfit_before']:.0f} to {first['misfit_after']:.0f}, "
        f"held out from {first['held_out_before']:.0f} to {first['held_out_after']:.0f}"
    )
    value = first["values"][first["best"]]
    if not first["held_out_agrees"]:
        return f"the best further candidate, {first['best']} ({value:+.3g}), fails at the held-out strides ({numbers})"
    reason = f"the best further candidate, {first['best']} ({value:+.3g}), is not named: p {first['p']:.2g} where "
    reason += f"{first['needed']:.2g} is asked ({numbers})"
    return reason + (f"; nor together with {refused[1]['best']}" if len(refused) > 1 else "")


def solve(fit: Fit, chosen: Sequence[Candidate]) -> Array:
    """The most promising move by the slopes, inside the candidates' limits."""
    low = [-each.limit - fit.values[each.name] - 1e-12 for each in chosen]
    high = [each.limit - fit.values[each.name] + 1e-12 for each in chosen]
    # scaled by the steps, so that radians and counts weigh alike
    steps = np.array([each.step for each in chosen])
    found = lsq_linear(fit.slopes * steps, -fit.misses, (np.array(low) / steps, np.array(high) / steps))
    return np.asarray(found.x * steps)


def tied(name: str, own: Array, others: Array, slopes: dict[str, Array | None]) -> tuple[str, ...]:
    """The candidates with this one's signature, after removing the part that the other causes explain."""

    def rest(column: Array) -> Array:
        if others.shape[1] == 0:
            return column
        return np.asarray(column - others @ np.linalg.lstsq(others, column, rcond=None)[0])

    mine = rest(own)
    found = []
    for other, column in slopes.items():
        if other == name or column is None:
            continue
        theirs = rest(column)
        size = float(np.linalg.norm(mine) * np.linalg.norm(theirs))
        if size > 0.0 and abs(float(mine @ theirs)) / size > TIE:
            found.append(other)
    return tuple(found)
