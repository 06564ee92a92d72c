"""Controller parameter sets: what the computer would load into the main brain, and the operator's script.

A set is a TOML file: `title`, `description`, `program` (programs.py; `record` if not given), [parameters] name = value,
[reasons] name = "why", and [operator]. A set with `base = "other set"` holds only what differs, and each difference has
a reason. A base may be of another program: what both read is taken from it. Every parameter that the program's machines
read has to have a value, and no other may be given; units and ranges are those of the data table. Whatever is wrong is
a UserError of one line: file, key, value, limit.
"""

import math
import pathlib
from dataclasses import dataclass, fields
from typing import Any

from ranger_sim.boards.main_brain import programs
from ranger_sim.boards.main_brain.programs import parameter_rows
from ranger_sim.datatable import parameters
from ranger_sim.datatable.generated import mb as table_ids
from ranger_sim.foundation import toml_file
from ranger_sim.foundation.user_error import ScenarioError, unknown

FOLDER = pathlib.Path(__file__).parent / "parameters"
DEFAULT_PROGRAM = "record"


@dataclass(frozen=True)
class KeyPress:
    """Key `key` (0-5) goes down at `time_s` after power-up and up `hold_s` later."""

    key: int
    time_s: float
    hold_s: float


@dataclass(frozen=True)
class Operator:
    """How a person starts the robot: held in a pose, keys, let go with a push.

    stance: "outer" or "inner", the legs that stand while held; lean_rad: their lean forward of vertical;
    hip_angle_rad: inner legs ahead; ankle angles as the joints measure them (1.68: sweet spot under the
    leg); release_time_s after power-up; release_rate_rad_per_s: rate given to the standing legs, positive
    forward; radio: steering stick, -1 to 1.
    """

    stance: str
    lean_rad: float
    hip_angle_rad: float
    outer_ankle_rad: float
    inner_ankle_rad: float
    release_time_s: float
    release_rate_rad_per_s: float
    radio: float
    keys: tuple


# Allowed values of the operator's numbers: beyond these no person could hold or push the robot so, or the
# joints do not reach (hip stop 0.614 rad, ankle 0 ... 3.2 rad; robot.md C4, C1.1).
OPERATOR_LIMITS = {
    "lean_rad": (-0.5, 0.5),
    "hip_angle_rad": (-0.6, 0.6),
    "outer_ankle_rad": (0.0, 3.2),
    "inner_ankle_rad": (0.0, 3.2),
    "release_time_s": (0.0, 60.0),
    "release_rate_rad_per_s": (-2.0, 2.0),
    "radio": (-1.0, 1.0),
}
KEY_LIMITS = {"key": (0, 5), "time_s": (0.0, 60.0), "hold_s": (0.05, 60.0)}


@dataclass(frozen=True)
class Controller:
    """One parameter set for `program`: `values` by name, `changes` against its base, `reasons` by name."""

    name: str
    path: str
    title: str
    description: str
    program: str
    base: str | None
    values: dict
    changes: dict
    reasons: dict
    operator: Operator

    def apply(self, store: Any) -> None:
        """Write every parameter into the data table, as the computer's link would."""
        for name, value in self.values.items():
            store.set_float(getattr(table_ids, name), value)


def available() -> tuple:
    """Names of the sets that come with the project."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def load(name: str | pathlib.Path) -> Controller:
    """The set `name`, or the file at that path when it ends in .toml."""
    return _load(str(name), ())


def _load(name: str, users: tuple[pathlib.Path, ...]) -> Controller:
    """The set `name`; `users`: the files whose base it is, the nearest one last."""
    path = pathlib.Path(name) if name.endswith(".toml") else FOLDER / f"{name}.toml"
    place = f"{users[-1]}: " if users else ""
    if not name.endswith(".toml") and name not in available():
        what = unknown("base" if users else "controller", name, available())
        raise ScenarioError(f"{place}{what}, or give a .toml file")
    if path.resolve() in [each.resolve() for each in users]:
        raise ScenarioError(f"{place}base {name!r} leads back to this set")
    data = toml_file.load(path, "controller file")
    place = str(path)
    _only(data, ("title", "description", "program", "base", "parameters", "reasons", "operator"), place)
    title = _text(data, "title", place, path.stem)
    description = _text(data, "description", place, "")
    base_name = _text(data, "base", place, None)
    base = None
    if base_name is not None:
        base = _load(base_name, (*users, path))
    program = _text(data, "program", place, base.program if base is not None else DEFAULT_PROGRAM)
    if program not in programs.PROGRAMS:
        raise ScenarioError(f"{place}: {unknown('program', program, programs.PROGRAMS)}")
    needed = programs.program(program).parameters()
    changes = _parameters(_table(data, "parameters", place), place)
    for each in changes:
        if each not in needed:
            raise ScenarioError(f"{place}: [parameters] {each}: the program {program!r} does not read it")
    values = {each: value for each, value in base.values.items() if each in needed} if base is not None else {}
    differences = [each for each in changes if each in values]
    values.update(changes)
    missing = [each for each in parameter_rows() if each in needed and each not in values]
    if missing:
        raise ScenarioError(f"{place}: [parameters] lacks {', '.join(missing)}; give them or a base")
    reasons = _table(data, "reasons", place)
    for each, reason in reasons.items():
        if each not in changes:
            raise ScenarioError(f"{place}: [reasons] {each}: no such entry in [parameters]")
        if not isinstance(reason, str) or not reason.strip():
            raise ScenarioError(f"{place}: [reasons] {each} = {reason!r}: a sentence is expected")
    unexplained = [each for each in differences if each not in reasons]
    if unexplained:
        raise ScenarioError(f"{place}: [reasons] lacks {', '.join(unexplained)}: each difference needs a reason")
    if "operator" in data:
        operator = _operator(_table(data, "operator", place), place)
    elif base is not None:
        operator = base.operator
    else:
        raise ScenarioError(f"{place}: [operator] is missing; give it or a base")
    return Controller(path.stem, place, title, description, program, base_name, values, changes, reasons, operator)


def _only(data: dict, allowed: tuple, place: str) -> None:
    for key in data:
        if key not in allowed:
            raise ScenarioError(f"{place}: unknown key {key!r}; allowed are {', '.join(allowed)}")


def _text(data: dict, key: str, place: str, default: Any) -> Any:
    value = data.get(key, default)
    if value is not default and not isinstance(value, str):
        raise ScenarioError(f"{place}: {key} = {value!r}: text is expected")
    return value


def _table(data: dict, key: str, place: str) -> dict:
    value = data.get(key, {})
    if not isinstance(value, dict):
        raise ScenarioError(f"{place}: {key} = {value!r}: a table [{key}] is expected")
    return value


def _number(value: Any, key: str, limits: tuple, unit: str, place: str) -> float:
    """`value` as a float within `limits` (either may be None)."""
    low, high = limits
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ScenarioError(f"{place}: {key} = {value!r}: a number is expected")
    if (low is not None and value < low) or (high is not None and value > high):
        raise ScenarioError(f"{place}: {key} = {value!r} is outside {low} to {high}{' ' + unit if unit else ''}")
    return float(value)


def _parameters(table: dict, place: str) -> dict:
    known = parameter_rows()
    values = {}
    for name, value in table.items():
        if name not in known:
            raise ScenarioError(f"{place}: [parameters] {name}: no such parameter (`ranger-sim table list --board PC`)")
        parameters.checked_word(known[name], value, place)
        values[name] = float(value)
    return values


def _operator(table: dict, place: str) -> Operator:
    names = tuple(field.name for field in fields(Operator))
    _only(table, names, f"{place}: [operator]")
    for name in names:
        if name not in table:
            raise ScenarioError(f"{place}: [operator] lacks {name}")
    if table["stance"] not in ("outer", "inner"):
        raise ScenarioError(f'{place}: [operator] stance = {table["stance"]!r}: "outer" or "inner" is expected')
    numbers = {
        name: _number(table[name], f"[operator] {name}", limits, "", place) for name, limits in OPERATOR_LIMITS.items()
    }
    if not isinstance(table["keys"], list) or not all(isinstance(key, dict) for key in table["keys"]):
        raise ScenarioError(f"{place}: [operator] keys = {table['keys']!r}: tables [[operator.keys]] are expected")
    keys = []
    for press in table["keys"]:
        _only(press, tuple(KEY_LIMITS), f"{place}: [[operator.keys]]")
        for name in KEY_LIMITS:
            if name not in press:
                raise ScenarioError(f"{place}: [[operator.keys]] lacks {name}")
        checked = {
            name: _number(press[name], f"[[operator.keys]] {name}", limits, "", place)
            for name, limits in KEY_LIMITS.items()
        }
        if checked["key"] != int(checked["key"]):
            raise ScenarioError(f"{place}: [[operator.keys]] key = {press['key']!r}: a whole number is expected")
        keys.append(KeyPress(int(checked["key"]), checked["time_s"], checked["hold_s"]))
    return Operator(stance=table["stance"], keys=tuple(keys), **numbers)
