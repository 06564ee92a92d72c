"""What may be asked of a running robot: REQUESTS is the model, `admitted` the only way in.

A request is a line with a JSON object: `do`, and the fields of that request, no others. Whatever is not so is a
UserError of one line that names the fault; nothing of it reaches the robot.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from typing import Any

from ranger_sim.datatable import parameters
from ranger_sim.datatable.parameters import shown
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness import wiring

KEYS = 6  # of the robot's panel: 0 ... 5


@dataclasses.dataclass(frozen=True)
class Request:
    """An admitted request; of the fields those count that its kind has. word: the value as the robot keeps it."""

    do: str
    key: int = 0
    board: str = ""
    name: str = ""
    value: float = 0.0
    word: int = 0


def _key(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < KEYS:
        raise UserError(f"key: {shown(value)} is not 0 to {KEYS - 1}")
    return value


def _board(value: Any) -> str:
    if not isinstance(value, str) or value not in wiring.BOARDS:
        raise UserError(f"restart: {shown(value)} is none of {', '.join(wiring.BOARDS)}")
    return value


def _parameter(value: Any) -> str:
    if not isinstance(value, str):
        raise UserError(f"set: {shown(value)} is no name of a parameter")
    return parameters.parameter(value).name


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
}


def admitted(line: bytes) -> Request:
    """The request in a line. UserError, of one line, for everything that is none."""
    content = _object(line)
    what = content.pop("do", None)
    fields = REQUESTS.get(what) if isinstance(what, str) else None
    if fields is None:
        raise UserError(f"{shown(what)} is no request; there are {', '.join(REQUESTS)}")
    for name in content:
        if name not in fields:
            raise UserError(f"{what}: {shown(name)} is no field of it; it has {', '.join(fields) or 'none'}")
    found: dict[str, Any] = {}
    for name, check in fields.items():
        if name not in content:
            raise UserError(f"{what}: {name} is missing")
        found[name] = check(content[name])
    if what == "set":
        found["word"] = parameters.checked_word(parameters.parameter(found["name"]), found["value"], "set")
        found["value"] = float(found["value"])
    return Request(what, **found)


def _object(line: bytes) -> dict[str, Any]:
    """The JSON object of a line, as the standard has it: numbers are finite, a name comes once."""

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        content = dict(pairs)
        if len(content) != len(pairs):
            raise UserError("a request has each field once")
        return content

    def finite(text: str) -> float:
        raise UserError(f"a request: {text} is no number in JSON")

    try:
        content = json.loads(line, object_pairs_hook=once, parse_constant=finite)
    except (ValueError, RecursionError):  # broken, not UTF-8, a number of thousands of digits, nested too deeply
        content = None
    if not isinstance(content, dict):
        raise UserError("a request is one line with a JSON object")
    return content
