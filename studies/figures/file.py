"""A question as a TOML file.

    title = "..."           description = "..."
    [run]                   what the simulator is to do; its keys are the simulator's
    [[figure]]              name, value, sd, model_sd, source; or endurance = true, at_least = true
    [[candidate]]           name, unit, low, high, known_sd, step, cause, meaning, source; [candidate.moves]: numbers of
                            the simulator that move with it, and by how much each; value: else that of the first
    [[measurement]]         name, sd, how: what could be measured next

All that is wrong with a file is a UserError of one line: file, place, value, what is allowed.
"""

import pathlib
from collections.abc import Callable, Mapping
from typing import Any

from ranger_sim.foundation import toml_file
from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.terms import is_number
from ranger_sim.sysid.causes import CAUSES
from studies.figures.question import Candidate, Figure, Measurement, Question

TABLES = {
    "figure": (("name", "value", "source"), ("sd", "model_sd", "endurance", "at_least")),
    "candidate": (
        ("name", "unit", "low", "high", "known_sd", "step", "cause", "moves", "source"),
        ("value", "meaning"),
    ),
    "measurement": (("name", "sd", "how"), ()),
}
TEXTS = ("name", "unit", "cause", "source", "meaning", "how")
KINDS: dict[str, tuple[type, str]] = {"title": (str, "text"), "description": (str, "text"), "run": (dict, "table")}
FLAGS = ("endurance", "at_least")


def load(path: pathlib.Path) -> dict[str, Any]:
    """The file's contents, its form checked; `question` makes a Question of it."""
    data = toml_file.load(path)
    allowed = ("title", "description", "run", *TABLES)
    for key, value in data.items():
        if key not in allowed:
            raise UserError(f"{path}: unknown key {key!r}; allowed are {', '.join(allowed)}")
        kind, word = KINDS.get(key, (list, "list of tables"))
        if not isinstance(value, kind):
            raise UserError(f"{path}: {key} = {value!r}: a {word} is expected")
    for table in TABLES:
        for number, entry in enumerate(data.get(table, []), 1):
            _check(path, table, number, entry)
    return data


def question(path: pathlib.Path, data: Mapping[str, Any], value_of: Callable[[str], float]) -> Question:
    """The question of a loaded file. value_of: the simulator's number of a name; UserError when it has none."""
    candidates = []
    for entry in data.get("candidate", []):
        try:
            bases = [value_of(name) for name in entry["moves"]]
            fields = {name: value for name, value in entry.items() if name != "moves"}
            moves = {name: float(factor) for name, factor in entry["moves"].items()}
            candidates.append(Candidate(**{"value": bases[0], **fields}, moves=moves))
        except UserError as error:
            raise UserError(f"{path}: candidate {entry['name']}: {error}") from None
    try:
        return Question(
            data.get("title", path.stem),
            tuple(Figure(**entry) for entry in data.get("figure", [])),
            tuple(candidates),
            tuple(Measurement(**entry) for entry in data.get("measurement", [])),
        )
    except UserError as error:
        raise UserError(f"{path}: {error}") from None


def _check(path: pathlib.Path, table: str, number: int, entry: Any) -> None:
    """UserError for an entry whose keys, or whose kinds of values, are not what the form has."""
    needed, more = TABLES[table]
    if not isinstance(entry, dict):
        raise UserError(f"{path}: {table} {number}: a table is expected")
    place = f"{path}: {table} {entry.get('name', number)}"
    for key in needed:
        if key not in entry:
            raise UserError(f"{place}: it lacks {key}")
    for key, value in entry.items():
        if key not in (*needed, *more):
            raise UserError(f"{place}: unknown key {key!r}; allowed are {', '.join((*needed, *more))}")
        if key in TEXTS:
            if not isinstance(value, str) or not value.strip():
                raise UserError(f"{place}: {key} = {value!r}: text is expected")
        elif key in FLAGS:
            if not isinstance(value, bool):
                raise UserError(f"{place}: {key} = {value!r}: true or false is expected")
        elif key == "moves":
            if not isinstance(value, dict) or not value or not all(map(is_number, value.values())):
                raise UserError(f"{place}: moves = {value!r}: a table of names and factors is expected")
        elif not is_number(value):
            raise UserError(f"{place}: {key} = {value!r}: a finite number is expected")
    causes = {each.identifier for each in CAUSES.values()}
    if table == "candidate" and entry["cause"] not in causes:
        raise UserError(f"{place}: cause {entry['cause']!r}: not in the catalogue (`ranger-sim causes` lists it)")
