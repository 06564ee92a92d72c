"""Conditions on a running robot, as tests, faults and campaigns write them.

    "12.3 s"                    virtual time since power-up
    "step 12"                   so many steps walked
    "hip in HI_premid"          a machine of the main brain is in a state (leg, hip, inner_foot, outer_foot, steering)
    "MCH_ANGLE > 0.3"           a variable, as the main brain's data table has it
    "hip_rad < -0.2"            a quantity of the body (plant.ranger.SAMPLES)
    "error MC_TCURR_OOB from MCH"   a board notes an error that it had not noted when the waiting began
    "fell"                      the robot fell

A function of the robot is a condition as well. Conditions are looked at between two steps of the plant, every 250 us.
"""

import array
import difflib
import operator
import re
from collections.abc import Callable
from typing import Any

from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.generated import errors as error_table
from ranger_sim.datatable.packing import value_of_word
from ranger_sim.foundation.quantities import NUMBER, TIMES, duration_text, in_base_units
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness import wiring
from ranger_sim.harness.step_watch import StepWatch
from ranger_sim.plant.ranger import SAMPLES

COMPARISONS: dict[str, Callable[[Any, Any], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
}
# machine: variable of its state in the main brain's table
STATE_VARIABLES = {
    "leg": "FSM_LEG",
    "hip": "FSM_HIP",
    "inner_foot": "FSM_FI",
    "outer_foot": "FSM_FO",
    "steering": "FSM_STEER",
}


class ConditionNotMetError(AssertionError):
    """A condition was not met in its time; the text says what was nearest."""


class Condition:
    """`text`: as it was written. `begin(robot)` once, then `met()` as often as it is asked."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.robot: Any = None

    def begin(self, robot: Any) -> None:
        """From now on the condition is about `robot`."""
        self.robot = robot

    def met(self) -> bool:
        """Whether it holds now."""
        raise NotImplementedError

    def nearest(self) -> str:
        """How near it came since `begin`, for the message of a test that waited in vain."""
        raise NotImplementedError


class At(Condition):
    """An instant, `time_ns` since power-up."""

    def __init__(self, text: str, time_ns: int) -> None:
        Condition.__init__(self, text)
        self.time_ns = time_ns

    def met(self) -> bool:
        return bool(self.robot.loop.time - self.robot.start_ns >= self.time_ns)

    def nearest(self) -> str:
        return f"it is {duration_text(self.robot.loop.time - self.robot.start_ns)} since power-up"


class Step(Condition):
    """So many steps since the robot was let go."""

    def __init__(self, text: str, steps: int) -> None:
        Condition.__init__(self, text)
        self.steps = steps

    def met(self) -> bool:
        return bool(self.robot.plant.steps >= self.steps)

    def nearest(self) -> str:
        return f"step {self.robot.plant.steps} was reached"


class Fell(Condition):
    """The robot lies on the floor."""

    def met(self) -> bool:
        return bool(self.robot.plant.fell)

    def nearest(self) -> str:
        return f"it walks, step {self.robot.plant.steps}"


class State(Condition):
    """A machine of the main brain is in a state."""

    def __init__(self, text: str, machine: str, state: str) -> None:
        Condition.__init__(self, text)
        if machine not in STATE_VARIABLES:
            raise UserError(f"condition {text!r}: machine {machine!r} is none of {', '.join(STATE_VARIABLES)}")
        self.machine = machine
        self.state = state
        self.place = all_variables.ID_OF[STATE_VARIABLES[machine]]
        self.names: dict[int, str] = {}
        self.number = -1
        self.seen: set[int] = set()

    def begin(self, robot: Any) -> None:
        Condition.begin(self, robot)
        states = getattr(robot.boards["MB"].modes, self.machine).machine.states
        self.names = {state.number: state.name for state in states}
        numbers = [number for number, name in self.names.items() if name == self.state]
        if not numbers:
            there = ", ".join(self.names.values())
            raise UserError(f"condition {self.text!r}: {self.machine} has no state {self.state!r}, but {there}")
        self.number = numbers[0]
        self.seen = set()

    def met(self) -> bool:
        now = int(self.robot.loop.board("MB").memory[self.place])
        self.seen.add(now)
        return now == self.number

    def nearest(self) -> str:
        been = ", ".join(self.names.get(number, str(number)) for number in sorted(self.seen))
        return f"{self.machine} was in {been or 'no state'}"


class Comparison(Condition):
    """A variable or a quantity of the body against a number."""

    def __init__(self, text: str, name: str, sign: str, value: float) -> None:
        Condition.__init__(self, text)
        self.name = name
        self.compare = COMPARISONS[sign]
        self.value = value
        self.closest: float | None = None
        self.variable = all_variables.ID_OF.get(name)
        self.column = list(SAMPLES).index(name) if name in SAMPLES else -1
        if self.variable is None and self.column < 0:
            near = difflib.get_close_matches(name, [*all_variables.ID_OF, *SAMPLES], 3)
            raise UserError(
                f"condition {text!r}: {name!r} is neither a variable of the table nor a quantity of the body"
                + (f"; meant was perhaps {' or '.join(near)}" if near else "")
            )
        self.row = array.array("d", [0.0]) * len(SAMPLES)

    def begin(self, robot: Any) -> None:
        Condition.begin(self, robot)
        self.closest = None

    def now(self) -> float:
        """Its value."""
        if self.variable is not None:
            word = self.robot.loop.board("MB").memory[self.variable]
            return float(value_of_word(all_variables.TYPES[self.variable], word))
        self.robot.plant.fill_sample(self.row)
        return self.row[self.column]

    def met(self) -> bool:
        now = self.now()
        if self.closest is None or abs(now - self.value) < abs(self.closest - self.value):
            self.closest = now
        return self.compare(now, self.value)

    def nearest(self) -> str:
        unit = all_variables.UNITS[self.variable] if self.variable is not None else SAMPLES[self.name]
        return f"the nearest value of {self.name} was {self.closest:.6g} {unit}".rstrip()


class ErrorNoted(Condition):
    """A board notes an error; `board` None: any board."""

    def __init__(self, text: str, error: str, board: str | None) -> None:
        Condition.__init__(self, text)
        codes = {name: code for code, name in error_table.NAMES.items()}
        if error not in codes:
            near = difflib.get_close_matches(error, codes, 3)
            raise UserError(
                f"condition {text!r}: the table has no error {error!r}"
                + (f"; meant was perhaps {' or '.join(near)}" if near else "")
            )
        if board is not None and board not in wiring.BOARDS:
            raise UserError(f"condition {text!r}: board {board!r} is none of {', '.join(wiring.BOARDS)}")
        self.code = codes[error]
        self.error = error
        self.boards = (board,) if board is not None else wiring.BOARDS
        self.before: list[int] = []  # by board

    def begin(self, robot: Any) -> None:
        Condition.begin(self, robot)
        self.before = self.counts()

    def counts(self) -> list[int]:
        """How often each of these boards noted it since its power-up."""
        return [int(errors_of(self.robot.loop.board(name))[self.code]) for name in self.boards]

    def met(self) -> bool:
        now = self.counts()
        noted = any(count > before for count, before in zip(now, self.before, strict=True))
        self.before = [min(pair) for pair in zip(now, self.before, strict=True)]  # a board that begins anew counts anew
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


def errors_of(board: Any) -> Any:
    """How often `board` noted each error, by number; also of a board in another process."""
    module = getattr(board, "errors", None)
    return module.totals if module is not None else board.counters().errors


def condition(wanted: str | Condition | Callable[[Any], Any]) -> Condition:
    """The condition that is written in `wanted`, or is it already. UserError for a text that is none."""
    if isinstance(wanted, Condition):
        return wanted
    if callable(wanted):
        return Function(wanted)
    text = " ".join(wanted.split())
    if text == "fell":
        return Fell(text)
    if match := re.fullmatch(r"step (\d+)", text):
        return Step(text, int(match.group(1)))
    if match := re.fullmatch(r"(\w+) in (\w+)", text):
        return State(text, match.group(1), match.group(2))
    if match := re.fullmatch(r"error (\w+)(?: from (\w+))?", text):
        return ErrorNoted(text, match.group(1), match.group(2))
    if match := re.fullmatch(rf"(\w+) ?(<=|>=|==|!=|<|>) ?({NUMBER})", text):
        return Comparison(text, match.group(1), match.group(2), float(match.group(3)))
    seconds = in_base_units(text, TIMES) if re.search(r"[a-z]$", text) else None
    if seconds is not None and seconds >= 0.0:
        return At(text, round(seconds * 1e9))
    raise UserError(
        f"condition {wanted!r}: it reads like 12.3 s, step 12, hip in HI_premid, MCH_ANGLE > 0.3, hip_rad < -0.2, "
        f"error MC_TCURR_OOB from MCH, or fell"
    )


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
