"""Sets of parameters as files: tab-separated (name, id, value), or a controller's .toml.

A saved .toml names a base set and holds the differences from it, so that `ranger-sim walk --controller` accepts it.
"""

from __future__ import annotations

import math
import pathlib

from ranger_sim.boards.main_brain import controllers
from ranger_sim.datatable import parameters
from ranger_sim.datatable.packing import word_of_value
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.command_line.files import replace_file
from ranger_sim.tools.robodaq import catalogue


def load(name: str) -> dict[str, float]:
    """{parameter: value}: a controller by name or .toml, or a tab-separated file. Everything is checked."""
    if name.endswith(".toml") or name in controllers.available():
        return dict(controllers.load(name).values)
    path = pathlib.Path(name)
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise UserError(f"parameter file {name}: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise UserError(f"parameter file {name}: not UTF-8 text (byte {error.start})") from None
    values: dict[str, float] = {}
    for number, line in enumerate(lines, start=1):
        place = f"{name}:{number}"
        if not line.strip():
            continue
        cells = [cell.strip() for cell in line.rstrip("\t").split("\t")]
        if len(cells) != 3:
            raise UserError(f"{place}: {line!r}: name, id and value with tabs between them are expected")
        try:
            row = parameters.parameter(cells[0])
        except UserError as mistake:
            raise UserError(f"{place}: {mistake}") from None
        if cells[1] != str(row.id):
            raise UserError(f"{place}: {row.name} has id {row.id} in this table, the file says {cells[1]!r}")
        if row.name in values:
            raise UserError(f"{place}: {row.name} a second time")
        try:
            value = float(cells[2])
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise UserError(f"{place}: {row.name} = {cells[2]!r}: a number is expected")
        parameters.checked_word(row, value, place)
        values[row.name] = value
    if not values:
        raise UserError(f"parameter file {name}: no parameters in it")
    return values


def check_target(name: str) -> pathlib.Path:
    """The path for saving a set: .txt or .toml in an existing folder."""
    path = pathlib.Path(name)
    if path.suffix not in (".txt", ".toml"):
        raise UserError(f"--save {name}: the name must end in .txt (tab-separated) or .toml (controller)")
    if path.is_dir() or not path.parent.is_dir():
        raise UserError(f"--save {name}: {'this is a folder' if path.is_dir() else 'there is no such folder'}")
    return path


def save(path: pathlib.Path, words: dict[str, int], base: str) -> None:
    """Write the parameters' words, as read from the robot."""
    text = as_controller(words, base) if path.suffix == ".toml" else as_table(words)
    replace_file(path, text.encode())


def as_table(words: dict[str, int]) -> str:
    """One line each: name, id, value."""
    rows = (parameters.find(name) for name in words)
    return "".join(f"{row.name}\t{row.id}\t{catalogue.text_of(row.id, words[row.name])}\n" for row in rows)


def as_controller(words: dict[str, int], base: str) -> str:
    """The differences from the set `base`, each with the reason that the format requires."""
    values = controllers.load(base).values
    changed = {
        name: catalogue.text_of(parameters.find(name).id, word)
        for name, word in words.items()
        if name in values and word != word_of_value("f32", values[name])
    }
    lines = [
        "# Parameters of the robot, read over its data link.",
        "",
        'title = "read from the robot"',
        f'base = "{base}"',
        "",
        "[parameters]",
        *(f"{name} = {toml_float(text)}" for name, text in changed.items()),
        "",
        "[reasons]",
        *(f'{name} = "as read from the robot"' for name in changed),
    ]
    return "\n".join(lines) + "\n"


def toml_float(text: str) -> str:
    """A number that TOML reads as a float."""
    return text if any(mark in text for mark in ".einf") else text + ".0"
