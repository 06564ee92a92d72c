"""Conditions on a running robot, as tests, faults and campaigns write them.

    "12.3 s"                    virtual time since power-up
    "step 12"                   a number of steps walked
    "hip in HI_premid"          a machine of the main brain is in a state (leg, hip, inner_foot, outer_foot, steering)
    "MCH_ANGLE > 0.3"           a variable, by the main brain's data table
    "hip_rad < -0.2"            a quantity of the body (plant.ranger.SAMPLES)
    "error MC_TCURR_OOB from MCH"   a board records an error after the waiting began
    "fell"                      the robot fell

A function of the robot is a condition as well. Conditions are checked between two steps of the plant, every 250 us.
"""

import re
from collections.abc import Callable
from typing import Any

from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.packing import value_of_word
from ranger_sim.foundation.user_error import ScenarioError, unknown
from ranger_sim.harness.ranger_names import RANGER
from ranger_sim.harness.waiting import (
    COMPARED,
    NOTED,
    Comparison,
    Condition,
    ConditionNotMetError,
    Ended,
    ErrorNoted,
    Function,
    Waiting,
    instant,
)
from ranger_sim.harness.wiring import ranger as wiring
from ranger_sim.plant.ranger import SAMPLES

__all__ = ["STATE_VARIABLES", "Condition", "ConditionNotMetError", "ErrorNoted", "Waiting", "condition", "state_names"]

# machine: variable of its state in the main brain's table
STATE_VARIABLES = {
    "leg": "FSM_LEG",
    "hip": "FSM_HIP",
    "inner_foot": "FSM_FI",
    "outer_foot": "FSM_FO",
    "steering": "FSM_STEER",
}


def state_names(robot: Any, machine: str) -> dict[int, str]:
    """{number: state} of a machine of the main brain's program; empty where that program does not have it."""
    states = getattr(robot.boards["MB"].modes, machine, None)
    return {} if states is None else {state.number: state.name for state in states.machine.states}


class Step(Condition):
    """A number of steps since the robot was let go."""

    def __init__(self, text: str, steps: int) -> None:
        Condition.__init__(self, text)
        self.steps = steps

    def met(self) -> bool:
        return bool(self.robot.plant.steps >= self.steps)

    def nearest(self) -> str:
        return f"step {self.robot.plant.steps} was reached"


class Fell(Ended):
    """The robot lies on the floor."""

    def nearest(self) -> str:
        return f"it walks, step {self.robot.plant.steps}"


class State(Condition):
    """A machine of the main brain is in a state."""

    def __init__(self, text: str, machine: str, state: str) -> None:
        Condition.__init__(self, text)
        if machine not in STATE_VARIABLES:
            raise ScenarioError(f"condition {text!r}: machine {machine!r} is none of {', '.join(STATE_VARIABLES)}")
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
            raise ScenarioError(f"condition {self.text!r}: {self.machine} has no state {self.state!r}, but {there}")
        self.number = numbers[0]
        self.seen = set()

    def met(self) -> bool:
        now = int(self.robot.loop.board("MB").memory[self.place])
        self.seen.add(now)
        return now == self.number

    def nearest(self) -> str:
        been = ", ".join(self.names.get(number, str(number)) for number in sorted(self.seen))
        return f"{self.machine} was in {been or 'no state'}"


class Quantity(Comparison):
    """A variable of the main brain's table, or a quantity of the body, compared with a number."""

    def __init__(self, text: str, name: str, sign: str, value: float) -> None:
        Comparison.__init__(self, text, name, sign, value, SAMPLES)
        self.variable = all_variables.ID_OF.get(name)
        if self.variable is None and self.column < 0:
            known = [*all_variables.ID_OF, *SAMPLES]
            raise ScenarioError(f"condition {text!r}: {unknown('variable or quantity of the body', name, known)}")

    def now(self) -> float:
        if self.variable is None:
            return Comparison.now(self)
        word = self.robot.loop.board("MB").memory[self.variable]
        return float(value_of_word(all_variables.TYPES[self.variable], word))

    def unit(self) -> str:
        return all_variables.UNITS[self.variable] if self.variable is not None else Comparison.unit(self)


def condition(wanted: str | Condition | Callable[[Any], Any]) -> Condition:
    """The condition described by `wanted`, a text or a condition. UserError for a text that does not describe one."""
    if isinstance(wanted, Condition):
        return wanted
    if callable(wanted):
        return Function(wanted)
    text = " ".join(wanted.split())
    if text == "fell":
        return Fell(text)
    if match := re.fullmatch(r"step ?(\d+)", text):
        return Step(f"step {match.group(1)}", int(match.group(1)))
    if match := re.fullmatch(r"(\w+) in (\w+)", text):
        return State(text, match.group(1), match.group(2))
    if match := re.fullmatch(NOTED, text):
        return ErrorNoted(text, match.group(1), match.group(2), RANGER, wiring.BOARDS)
    if match := re.fullmatch(COMPARED, text):
        return Quantity(text, match.group(1), match.group(2), float(match.group(3)))
    if (at := instant(text)) is not None:
        return at
    raise ScenarioError(
        f"condition {wanted!r}: it reads like 12.3 s, step 12, hip in HI_premid, MCH_ANGLE > 0.3, hip_rad < -0.2, "
        f"error MC_TCURR_OOB from MCH, or fell"
    )
