"""The requests to a running robot: REQUESTS is the model, `admitted` the only way in.

A request is a line with a JSON object: `do`, and exactly the fields of that request. Any other line is a
UserError of one line that names the fault; nothing of it reaches the robot.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

from ranger_sim.datatable import parameters
from ranger_sim.datatable.parameters import shown
from ranger_sim.foundation import json_text
from ranger_sim.foundation.user_error import RequestError
from ranger_sim.harness.faults.fault import Fault
from ranger_sim.harness.processes.plant_process import MOST_FAULTS
from ranger_sim.ranger import wiring
from ranger_sim.ranger.conditions import ErrorNoted
from ranger_sim.ranger.faults.catalogue import CATALOGUE

KEYS = 6  # of the robot's panel: 0 ... 5


@dataclasses.dataclass(frozen=True)
class Request:
    """An admitted request; only the fields of its kind count. word: the value as the robot stores it.

    fault: as typed after --fault. which: of the faults, in the order in which they were armed, from 0.
    stick: of the radio, -1 (left) to 1.
    """

    do: str
    key: int = 0
    fault: str = ""
    which: int = 0
    stick: float = 0.0
    board: str = ""
    name: str = ""
    value: float = 0.0
    word: int = 0


def _key(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < KEYS:
        raise RequestError(f"key: {shown(value)} is not 0 to {KEYS - 1}")
    return value


def _board(value: Any) -> str:
    if not isinstance(value, str) or value not in wiring.BOARDS:
        raise RequestError(f"restart: {shown(value)} is none of {', '.join(wiring.BOARDS)}")
    return value


def _parameter(value: Any) -> str:
    if not isinstance(value, str):
        raise RequestError(f"set: {shown(value)} is not the name of a parameter")
    return parameters.parameter(value).name


def _fault(value: Any) -> str:
    if not isinstance(value, str):
        raise RequestError(f"fault: {shown(value)} is not a fault, as PLACE:MODE")
    return can_be_armed(CATALOGUE.typed(value)).text()


def can_be_armed(fault: Fault) -> Fault:
    """The fault, if the body's process can arm it. UserError for one that waits for a counter of another process."""
    for each in (fault.start, fault.end):
        if isinstance(each, ErrorNoted):
            raise RequestError(
                f"fault {fault.text()}: {each.text!r} is counted in the process of its board, and asked for only "
                "at the end; a time, a step, a state or a variable can be waited for here"
            )
    return fault


def _which(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= MOST_FAULTS:
        raise RequestError(f"clear: {shown(value)} is no number of a fault, 0 to {MOST_FAULTS}")
    return value


def _stick(value: Any) -> float:
    number = parameters.number_of(value)
    if number is None or not -1.0 <= number <= 1.0:
        raise RequestError(f"radio: {shown(value)} is not -1 (left) to 1 (right)")
    return number


def _anything(value: Any) -> Any:
    """A value to `set`: the table's row decides, once the name is known."""
    return value


# do: {field: its check}
REQUESTS: dict[str, dict[str, Callable[[Any], Any]]] = {
    "status": {},
    "pause": {},
    "resume": {},
    "key": {"key": _key},
    "set": {"name": _parameter, "value": _anything},
    "restart": {"board": _board},
    "fault": {"fault": _fault},
    "clear": {"which": _which},
    "radio": {"stick": _stick},
}


def admitted(line: bytes) -> Request:
    """The request in a line. UserError, of one line, for any other line."""
    content = _object(line)
    what = content.pop("do", None)
    fields = REQUESTS.get(what) if isinstance(what, str) else None
    if fields is None:
        raise RequestError(f"{shown(what)} is not a request; there are {', '.join(REQUESTS)}")
    for name in content:
        if name not in fields:
            raise RequestError(f"{what}: unknown field {shown(name)} (available: {', '.join(fields) or 'none'})")
    found: dict[str, Any] = {}
    for name, check in fields.items():
        if name not in content:
            raise RequestError(f"{what}: {name} is missing")
        found[name] = check(content[name])
    if what == "set":
        found["word"] = parameters.checked_word(parameters.parameter(found["name"]), found["value"], "set")
        found["value"] = float(found["value"])
    return Request(what, **found)


def _object(line: bytes) -> dict[str, Any]:
    """The JSON object of a line."""
    try:
        content = json_text.loads(line, "a request")
    except json_text.JsonError as mistake:
        raise RequestError(f"a request is one line with a JSON object ({mistake.reason})") from None
    if not isinstance(content, dict):
        raise RequestError("a request is one line with a JSON object")
    return content
