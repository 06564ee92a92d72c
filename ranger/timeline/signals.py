"""Signals with a value at every time: variables of the data table, duties of bridges, states of the machines."""

from typing import Any

import numpy as np

from ranger_sim.boards.modules.motor_output import PERIOD_COUNTS
from ranger_sim.datatable.generated import all_variables
from ranger_sim.foundation.events import PWM_UPDATE
from ranger_sim.harness.timeline.frames import NUMPY_TYPES
from ranger_sim.harness.timeline.model import Counter, Slices, changes, runs
from ranger_sim.ranger.conditions import STATE_VARIABLES, state_names


def variables(rows: np.ndarray, zero_ns: int) -> list[Counter]:
    """Every variable that changed, by the main brain's table; `rows`: of the words' stream (time first)."""
    time = rows[:, 0] - zero_ns
    found = []
    for number, name in all_variables.NAMES.items():
        at, words = changes(time, rows[:, 1 + number])
        if len(at) > 1:
            values = words.astype(np.uint32).view(NUMPY_TYPES[all_variables.TYPES[number]])
            group = name.partition("_")[0]
            found.append(Counter(("Variables", group, name), all_variables.UNITS[number], at, values))
    return sorted(found, key=lambda counter: counter.path)


def machine_states(robot: Any, rows: np.ndarray, zero_ns: int, end_ns: int) -> list[Slices]:
    """The states of the main brain's machines as slices, from one sample of its table to another."""
    time = rows[:, 0] - zero_ns
    found = []
    for machine, variable in STATE_VARIABLES.items():
        names = state_names(robot, machine)
        start, end, state = runs(time, rows[:, 1 + all_variables.ID_OF[variable]], end_ns)
        numbers = sorted(set(state.tolist()))
        found.append(
            Slices(
                path=("Machines", machine.replace("_", " ")),
                names=[names.get(number, f"state {number}") for number in numbers],
                start_ns=start,
                end_ns=end,
                name=np.searchsorted(np.array(numbers, dtype=np.int64), state),
            )
        )
    return found


def duties(board: str, rows: np.ndarray, zero_ns: int) -> list[Counter]:
    """The duty of a bridge, -1 ... 1: the difference of its two leads, as a share of the period."""
    writes = rows[rows[:, 1] == PWM_UPDATE]
    time, duty = changes(writes[:, 0] - zero_ns, (writes[:, 2] - writes[:, 3]) / PERIOD_COUNTS)
    return [Counter(("Boards", board, "duty"), "", time, duty)] if len(time) else []
