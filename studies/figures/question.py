"""The question of a diagnosis from figures: measured figures, candidates that may be wrong, possible measurements.

Figure        one measured number, its errors, its source; or how far the machine got before it failed
Candidate     one number of the simulated machine that may be wrong, its limits, and how well it is known
Measurement   a further figure that could be measured, and how well
Point, Outcome, Simulator: the input and the output of the simulator that is passed in
"""

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeAlias

from ranger_sim.foundation.user_error import UserError


@dataclasses.dataclass(frozen=True)
class Figure:
    """One measured number.

    sd: standard deviation of the measurement. model_sd: error of the simulator with every candidate right; without it a
    simulator that errs elsewhere would have to meet a measurement that it cannot meet. endurance: the value is how far
    the machine got before it failed, in the unit of `Outcome.survived`; at_least: it had not failed then.
    """

    name: str
    value: float
    sd: float = 0.0
    model_sd: float = 0.0
    source: str = ""
    endurance: bool = False
    at_least: bool = False

    def __post_init__(self) -> None:
        if not math.isfinite(self.value):
            raise UserError(f"figure {self.name}: value {self.value!r}, a finite number is expected")
        if self.endurance:
            if self.value <= 0.0 or self.sd or self.model_sd:
                raise UserError(f"figure {self.name}: of an endurance a value above 0 is expected, and no sd")
        elif not 0.0 < self.error < math.inf or min(self.sd, self.model_sd) < 0.0:
            raise UserError(
                f"figure {self.name}: sd {self.sd:g} and model_sd {self.model_sd:g}, one above 0 is expected"
            )
        elif self.at_least:
            raise UserError(f"figure {self.name}: only an endurance can be at_least")

    @property
    def error(self) -> float:
        """Measurement and model together."""
        return math.hypot(self.sd, self.model_sd)


@dataclasses.dataclass(frozen=True)
class Candidate:
    """One number that may be wrong. value: as the simulation has it; low, high: limits that no machine exceeds.

    known_sd: how well the person who measured `value` knows it (a tape measure's error, the rounding of a printed
    number). step: the change of the first simulations of its effect. moves: numbers of the simulator that move with
    it, by name, and by how much each. cause: identifier of the catalogue (sysid/causes.py).
    """

    name: str
    unit: str
    value: float
    low: float
    high: float
    known_sd: float
    step: float
    cause: str
    moves: Mapping[str, float]
    meaning: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.value) and self.low <= self.value <= self.high and self.low < self.high):
            raise UserError(
                f"candidate {self.name}: {self.value!r} {self.unit} is not within its limits "
                f"{self.low:g} to {self.high:g}"
            )
        for name in ("known_sd", "step"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise UserError(f"candidate {self.name}: {name} is {getattr(self, name)!r}, it must be above 0")

    @property
    def spread(self) -> float:
        """Its standard deviation when only its limits are known: of a uniform distribution between them."""
        return (self.high - self.low) / math.sqrt(12.0)


@dataclasses.dataclass(frozen=True)
class Measurement:
    """A figure that could be measured next. name: one of the simulator's; how: instruction for a person."""

    name: str
    sd: float
    how: str = ""

    def __post_init__(self) -> None:
        if not 0.0 < self.sd < math.inf:
            raise UserError(f"measurement {self.name}: sd is {self.sd!r}, it must be above 0")


@dataclasses.dataclass(frozen=True)
class Question:
    """The complete question. UserError for repeated names, and for a question without figures or candidates."""

    title: str
    figures: tuple[Figure, ...]
    candidates: tuple[Candidate, ...]
    measurements: tuple[Measurement, ...] = ()

    def __post_init__(self) -> None:
        for what in ("figures", "candidates", "measurements"):
            names = [each.name for each in getattr(self, what)]
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise UserError(f"{what}: {', '.join(twice)} comes twice")
        if not any(not each.endurance for each in self.figures):
            raise UserError("figures: none; at least one that is not an endurance is needed")
        if sum(each.endurance for each in self.figures) > 1:
            raise UserError("figures: only one can be an endurance")
        if not self.candidates:
            raise UserError("candidates: none; at least one is needed")

    @property
    def gait(self) -> tuple[Figure, ...]:
        """Figures with a standard deviation."""
        return tuple(each for each in self.figures if not each.endurance)

    @property
    def endurance(self) -> Figure | None:
        """The endurance, if the question has one."""
        return next((each for each in self.figures if each.endurance), None)


@dataclasses.dataclass(frozen=True)
class Point:
    """One run to simulate: changes of the candidates' values, by name (others are unchanged), and the seed."""

    changes: tuple[tuple[str, float], ...]
    seed: int


@dataclasses.dataclass(frozen=True)
class Outcome:
    """One simulated run. figures: its results, without those that it did not reach.

    survived: how far it got after the start, in the endurance's unit (steps); failed: it ended there.
    """

    figures: Mapping[str, float]
    survived: float = 0.0
    failed: bool = False


# Outcomes in the order of the points. The same points give the same outcomes, however many processes work on them.
Simulator: TypeAlias = Callable[[Sequence[Point]], Iterable[Outcome]]
