"""What the logging program knows of the robot: its master table, and what may be written."""

from __future__ import annotations

import difflib
import fnmatch
import functools
import math

from ranger_sim import datatable
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.model import LIMITS, Variable
from ranger_sim.datatable.packing import value_of_word, word_of_value
from ranger_sim.foundation.user_error import UserError

CHANNEL_PREFIX = "LV_"  # the link's own variables: channels are chosen, not written


@functools.cache
def rows() -> dict[str, Variable]:
    """Every variable by name."""
    return {row.name: row for row in datatable.load().variables}


@functools.cache
def error_texts() -> dict[int, tuple[str, str]]:
    """Name and description of every error code."""
    return {row.id: (row.name, row.description) for row in datatable.load().errors}


def find(name: str) -> Variable:
    """The variable of this name; UserError with the nearest names when there is none."""
    row = rows().get(name)
    if row is None:
        near = difflib.get_close_matches(name, rows(), 3)
        raise UserError(f"{name!r}: no such variable" + (f"; did you mean {', '.join(near)}?" if near else ""))
    return row


def match(pattern: str) -> list[Variable]:
    """The variable of this name, or all that a pattern with * or ? fits."""
    if not any(mark in pattern for mark in "*?["):
        return [find(pattern)]
    found = [row for name, row in rows().items() if fnmatch.fnmatchcase(name, pattern)]
    if not found:
        raise UserError(f"{pattern!r}: fits no variable")
    return found


def is_parameter(row: Variable) -> bool:
    """True for what the computer publishes, so that it may be written."""
    return row.publisher == "PC" and not row.name.startswith(CHANNEL_PREFIX)


@functools.cache
def parameters() -> tuple[Variable, ...]:
    """Every parameter, in the order of the table."""
    return tuple(row for row in rows().values() if is_parameter(row))


def parameter(name: str) -> Variable:
    """The parameter of this name; UserError for everything else."""
    row = find(name)
    if row.name.startswith(CHANNEL_PREFIX):
        raise UserError(f"{name}: not a parameter; --fast and --medium set the channels of the link")
    if not is_parameter(row):
        raise UserError(f"{name}: not a parameter, it is published by {row.publisher}; the robot would refuse it")
    return row


def checked_word(row: Variable, value: float, place: str = "") -> int:
    """The word that is sent for a parameter's value; UserError when the value is outside its limits."""
    where = f"{place}: " if place else ""
    low, high = row.minimum, row.maximum
    if not math.isfinite(value):
        raise UserError(f"{where}{row.name} = {value}: a number is expected")
    if (low is not None and value < low) or (high is not None and value > high):
        raise UserError(
            f"{where}{row.name} = {value:g} is outside {low:g} to {high:g}{' ' + row.unit if row.unit else ''}"
        )
    low, high = LIMITS[row.type]
    if not low <= value <= high or (row.type != "f32" and value != int(value)):
        raise UserError(f"{where}{row.name} = {value:g} does not fit into its type, {row.type}")
    return word_of_value(row.type, value)


def value_of(number: int, word: int) -> float | int:
    """The number that a point's word stands for."""
    return value_of_word(all_variables.TYPES[number], word)


def text_of(number: int, word: int) -> str:
    """The shortest decimal that gives the word back."""
    value = value_of(number, word)
    if all_variables.TYPES[number] != "f32":
        return str(value)
    if not math.isfinite(value):
        return repr(value)
    shortest = next(n for d in range(1, 10) if word_of_value("f32", n := float(f"{value:.{d}g}")) == word)
    return repr(shortest).removesuffix(".0")
