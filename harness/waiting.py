"""Waiting for something in a machine: a condition is checked between two steps of its plant.

This module has the conditions of any machine: a time ("12.3 s"), a quantity of its body ("angle_rad > 0.5"), an
error that a board records ("error FOLLOWING from CONTROL"), its end, a function. Ranger's own: harness/conditions.py.
"""

import array
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ranger_sim.foundation.quantities import NUMBER, TIMES, duration_text, in_base_units
from ranger_sim.foundation.user_error import UserError, unknown
from ranger_sim.harness.names import Names
from ranger_sim.harness.step_watch import StepWatch

COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
}
NOTED = r"error (\w+)(?: from (\w+))?"
COMPARED = rf"(\w+) ?(<=|>=|==|!=|<|>) ?({NUMBER})"


class ConditionNotMetError(AssertionError):
    """A condition was not met in its time; the message has the nearest value."""


class Condition:
    """`text`: as written. Call `begin(robot)` once, then `met()` any number of times."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.robot: Any = None

    def begin(self, robot: Any) -> None:
        """Apply the condition to `robot` from now on."""
        self.robot = robot

    def met(self) -> bool:
        """Whether it holds now."""
        raise NotImplementedError

    def nearest(self) -> str:
        """The nearest value since `begin`, for the message of a test that waited in vain."""
        raise NotImplementedError


Wanted = str | Condition | Callable[[Any], Any]  # as written


class At(Condition):
    """A time, `time_ns` since power-up."""

    def __init__(self, text: str, time_ns: int) -> None:
        Condition.__init__(self, text)
        self.time_ns = time_ns

    def met(self) -> bool:
        return bool(self.robot.loop.time - self.robot.start_ns >= self.time_ns)

    def nearest(self) -> str:
        return f"it is {duration_text(self.robot.loop.time - self.robot.start_ns)} since power-up"


class Ended(Condition):
    """The machine can go no further, as its plant reports."""

    def met(self) -> bool:
        return bool(self.robot.plant.fell)

    def nearest(self) -> str:
        return "it goes on"


class Comparison(Condition):
    """A comparison of a quantity of the body with a number. `quantities`: {name: unit}, as the plant samples them."""

    def __init__(self, text: str, name: str, sign: str, value: float, quantities: Mapping[str, str]) -> None:
        Condition.__init__(self, text)
        self.name = name
        self.compare = COMPARISONS[sign]
        self.value = value
        self.closest: float | None = None
        self.quantities = quantities
        self.column = list(quantities).index(name) if name in quantities else -1
        self.row = array.array("d", [0.0]) * len(quantities)

    def begin(self, robot: Any) -> None:
        Condition.begin(self, robot)
        self.closest = None

    def now(self) -> float:
        """Its value."""
        self.robot.plant.fill_sample(self.row)
        return self.row[self.column]

    def met(self) -> bool:
        now = self.now()
        if self.closest is None or abs(now - self.value) < abs(self.closest - self.value):
            self.closest = now
        return self.compare(now, self.value)

    def unit(self) -> str:
        """Unit of the quantity."""
        return self.quantities[self.name]

    def nearest(self) -> str:
        return f"the nearest value of {self.name} was {self.closest:.6g} {self.unit()}".rstrip()


class ErrorNoted(Condition):
    """One of `boards` records an error of `names`; `board` None: any of them."""

    def __init__(self, text: str, error: str, board: str | None, names: Names, boards: Sequence[str]) -> None:
        Condition.__init__(self, text)
        if error not in names.codes:
            raise UserError(f"condition {text!r}: {unknown('error', error, names.codes)}")
        if board is not None and board not in boards:
            raise UserError(f"condition {text!r}: {unknown('board', board, boards)}")
        self.code = names.codes[error]
        self.error = error
        self.boards = (board,) if board is not None else tuple(boards)
        self.before: list[int] = []  # by board

    def begin(self, robot: Any) -> None:
        Condition.begin(self, robot)
        self.before = self.counts()

    def counts(self) -> list[int]:
        """How often each of these boards recorded it since its power-up."""
        return [self.count_of(self.robot.loop.board(name)) for name in self.boards]

    def count_of(self, board: Any) -> int:
        """The same for one board, also of one in another process."""
        module = getattr(board, "errors", None)
        totals = module.totals if module is not None else board.counters().errors
        return int(totals[self.code]) if self.code < len(totals) else 0

    def met(self) -> bool:
        now = self.counts()
        noted = any(count > before for count, before in zip(now, self.before, strict=True))
        self.before = [min(pair) for pair in zip(now, self.before, strict=True)]  # a restarted board counts anew
        return noted

    def nearest(self) -> str:
        return f"{', '.join(self.boards)} noted no {self.error}"


class Function(Condition):
    """A function of the robot."""

    def __init__(self, function: Callable[[Any], Any]) -> None:
        Condition.__init__(self, getattr(function, "__name__", repr(function)))
        self.function = function

    def met(self) -> bool:
        return bool(self.function(self.robot))

    def nearest(self) -> str:
        return "it never returned a true value"


def instant(text: str) -> At | None:
    """The condition of a text like "12.3 s"; None for other texts."""
    seconds = in_base_units(text, TIMES) if re.search(r"[a-z]$", text) else None
    return At(text, round(seconds * 1e9)) if seconds is not None and seconds >= 0.0 else None


def condition(
    wanted: Wanted, quantities: Mapping[str, str], names: Names | None = None, boards: Sequence[str] = ()
) -> Condition:
    """Make the condition of `wanted`, a text or already a condition, for a machine of these `boards` whose plant
    samples `quantities` and whose table has `names`.
    """
    if isinstance(wanted, Condition):
        return wanted
    if callable(wanted):
        return Function(wanted)
    text = " ".join(wanted.split())
    if text == "ended":
        return Ended(text)
    if match := re.fullmatch(COMPARED, text):
        name, sign, value = match.groups()
        if name not in quantities:
            raise UserError(f"condition {text!r}: {unknown('quantity of the body', name, quantities)}")
        return Comparison(text, name, sign, float(value), quantities)
    if match := re.fullmatch(NOTED, text):
        return ErrorNoted(text, match.group(1), match.group(2), names if names is not None else Names(), boards)
    at = instant(text)
    if at is None:
        example = next(iter(quantities), "angle_rad")
        error = f", error {next(iter(names.codes))}" if names is not None and names.codes else ""
        raise UserError(f"condition {wanted!r}: it reads like 12.3 s, {example} > 0.3{error}, or ended")
    return at


class Waiting(StepWatch):
    """Stops the loop as soon as a condition holds."""

    def __init__(self, robot: Any, wanted: Condition) -> None:
        StepWatch.__init__(self)
        self.wanted = wanted
        self.loop = robot.loop
        self.met = False
        wanted.begin(robot)

    def before_step(self, now_ns: int) -> None:
        if self.wanted.met():
            self.met = True
            self.loop.stop_wanted = True
