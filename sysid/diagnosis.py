"""The workings of a diagnosis: regressions and named effects, from which `answer.py` makes its result."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from ranger_sim.sysid import intervals, misfit, plausibility
from ranger_sim.sysid.left_over import LeftOver
from ranger_sim.sysid.machine import Effect, Machine, Recording
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.regression import Regression
from ranger_sim.sysid.results import DiagnosisResult, HeldOutError, NoiseFloor
from ranger_sim.sysid.three_numbers import gained

# Of all general tests together. Chosen by us: their chi-squares are valid for many samples only, and 0.001 gave 1 alarm
# in 30 sound recordings of the motor bench; effects worth a name are far below it.
GENERAL_LEVEL = 0.0001
LITTLE = 0.02  # of the residual's square: an integrator's own error is predictable too
# Chance of a misfit, and its part of the residual's square, that count whatever held-out data show. Surrogates give no
# chance below 0.0025; sound recordings have predictable parts of up to 0.24
SURELY, MUCH = 1e-6, 0.3
EXPLAINED = 0.7  # of the repeatable excess: causes that explain less are not named
# The same of what can be predicted in the data that the causes were chosen on. A bump of torque that a leg has and the
# catalogue has not is explained to 0.71 and 0.72 by a bend of its spring; true causes explain 0.98 and more there.
EXPLAINED_IN_TRAINING = 0.8
# Of what names and the largest table over one signal take together. Iron that saturates is explained to 0.83 to 0.89
# by a scale of the current, a load cell that creeps to 0.6 to 0.75; true causes leave nothing, or are above 0.91.
EXPLAINED_BY_NAMES = 0.88


@dataclasses.dataclass(frozen=True)
class KnownEffect:
    """An effect that the model has already: its shape, and its coefficients in the model."""

    cause: str
    at: str
    coefficients: Mapping[str, float]
    shape: Mapping[str, float]


@dataclasses.dataclass(frozen=True)
class Visible:
    """The smallest size of an effect that the data would show, by coefficient; None: these channels do not show it."""

    effect: Effect
    sizes: Mapping[str, float] | None
    shape: Mapping[str, float]


@dataclasses.dataclass
class Diagnosis:
    """What a diagnosis works with, for the report; `result` is what it returns."""

    machine: Machine
    recordings: list[Recording]
    plain: Regression
    extended: Regression
    skews: list[Named]  # stamps that are off, and the model's known effects: in the base of both regressions
    had: list[Named]  # the known effects alone, in the order of `known`
    known: list[KnownEffect]
    named: list[Named]
    intervals: dict[str, intervals.Intervals]  # of the named effects, by name, over every shape that explains the data
    before: misfit.Misfit
    after: misfit.Misfit
    doubts: plausibility.Doubts
    level: float = GENERAL_LEVEL  # of the tests without a cause in mind
    band_hz: float | None = None  # edge of the band of the equations; None: as recorded
    refused: list[Named] = dataclasses.field(default_factory=list)  # by held-out data, while causes were sought
    errors: dict[str, HeldOutError] | None = None  # on held-out data, by equation
    floors: dict[str, NoiseFloor] = dataclasses.field(default_factory=dict)  # by equation, where the noise is known
    visible: list[Visible] = dataclasses.field(default_factory=list)
    stretches: dict[str, float] = dataclasses.field(default_factory=dict)  # independent ones, by equation
    numerics: dict[str, tuple[float, ...]] = dataclasses.field(default_factory=dict)  # moves of coefficients, by effect
    below_numerics: list[str] = dataclasses.field(default_factory=list)  # effects that are not named for it
    by_candidates: bool = False  # found with the noise that all candidates leave
    left_over: LeftOver | None = None  # by the named effects, and goes with one signal
    result: DiagnosisResult = dataclasses.field(init=False)  # made last, by answer.py alone

    @property
    def answer(self) -> dict[str, Any]:
        """The result as plain data."""
        return self.result.to_dict()

    @property
    def detected(self) -> bool:
        """Something is wrong."""
        general = self.before.p < self.level
        if self.by_candidates:
            general = general and self.before.excess > LITTLE and self._seen_on_held_out()
        return general or bool(self.named) or self.doubts.forbid

    @property
    def explained(self) -> float:
        """Share of the repeatable excess that the named effects explain."""
        if self.by_candidates:
            return min(self._explained_of_predictable(), self._explained_by_names())
        gained = sum(each.chi2 - each.freedom for each in self.named)
        total = gained + self.after.excess
        return float(gained / total) if total > 0.0 else 0.0

    def _seen_on_held_out(self) -> bool:
        """False where chance alone hardly explains the misfit, but a black box gains nothing by it on held-out data.

        They do not show what goes with time, which the black box does not have; and a name that they refuse may be true
        of the other recordings alone.
        """
        if not self.errors or self.refused or self.before.p < SURELY or self.before.excess > MUCH:
            return True
        if not {"t", "time"}.isdisjoint(self.before.telling.features.split()):
            return True
        return any(
            each.black_box is not None and each.black_box**2 < (1.0 - LITTLE) * each.before**2
            for each in self.errors.values()
        )

    def _more_on_held_out(self) -> bool:
        """True unless held-out data show that a black box explains little more than the named effects do.

        They do not show it of a line in time, which the black box does not have.
        """
        if not self.errors or self.after.telling.features.startswith("a line"):
            return True
        won, possible, _ = gained(self.errors.values())
        return won < EXPLAINED * possible

    def _explained_of_predictable(self) -> float:
        """What the named effects take of the residual's square, of that and of what is predictable after them.

        Each equation counts by what it leaves: one may have next to no noise.
        """
        if not self.named:
            return 0.0
        won = {name: _left(self.plain, name) / _left(self.extended, name) - 1.0 for name in self.plain.equations}
        total = sum(won.values())
        more = {
            name: max((each.share for each in self.after.tests if each.equation == name), default=0.0) for name in won
        }
        return total / (total + sum(more.values())) if total > 0.0 else 0.0

    def _explained_by_names(self) -> float:
        """What the named effects take of the whitened square, of that and of what then goes with one signal."""
        if self.left_over is None or self.left_over.p >= self.level:
            return 1.0
        won = self.plain.chi2 - self.extended.chi2
        return won / (won + self.left_over.chi2) if self.named else 0.0

    @property
    def doubtful(self) -> bool:
        """Something is wrong, and its cause cannot be named."""
        if self.by_candidates:
            predictable = self._explained_of_predictable() < EXPLAINED_IN_TRAINING and self._more_on_held_out()
            left = (predictable and self.after.p < self.level) or self._explained_by_names() < EXPLAINED_BY_NAMES
        else:
            left = self.explained < EXPLAINED and self.after.p < self.level and self._more_on_held_out()
        return self.detected and (not self.named or self.doubts.forbid or left)


def _left(regression: Regression, name: str) -> float:
    """Mean square that an equation leaves, not whitened, over its rows that count."""
    part, good = regression.parts[name], regression.good[name]
    values = np.array([regression.values[each] for each in regression.names])
    left = part.response[good] - part.measured[good] @ values
    return max(float(left @ left) / max(1, len(left)), 1e-300)
