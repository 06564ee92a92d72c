"""The workings of a diagnosis: regressions and named effects, from which `answer.py` makes its result."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from ranger_sim.sysid import intervals, misfit, plausibility
from ranger_sim.sysid.machine import Machine, Recording
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.regression import Regression
from ranger_sim.sysid.results import DiagnosisResult

# Of all general tests together. Chosen by us: their chi-squares are valid for many samples only, and 0.001 gave 1 alarm
# in 30 sound recordings of the motor bench; effects worth a name are far below it.
GENERAL_LEVEL = 0.0001
EXPLAINED = 0.7  # of the repeatable excess: causes that explain less are not named


@dataclasses.dataclass(frozen=True)
class KnownEffect:
    """An effect that the model has already: its shape, and its coefficients in the model."""

    cause: str
    at: str
    coefficients: Mapping[str, float]
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
    result: DiagnosisResult = dataclasses.field(init=False)  # made last, by answer.py alone

    @property
    def answer(self) -> dict[str, Any]:
        """The result as plain data."""
        return self.result.to_dict()

    @property
    def detected(self) -> bool:
        """Something is wrong."""
        return self.before.p < GENERAL_LEVEL or bool(self.named) or self.doubts.forbid

    @property
    def explained(self) -> float:
        """Share of the repeatable excess that the named effects explain."""
        gained = sum(each.chi2 - each.freedom for each in self.named)
        total = gained + self.after.excess
        return float(gained / total) if total > 0.0 else 0.0

    @property
    def doubtful(self) -> bool:
        """Something is wrong, and its cause cannot be named."""
        left = self.explained < EXPLAINED and self.after.p < GENERAL_LEVEL
        return self.detected and (not self.named or self.doubts.forbid or left)
