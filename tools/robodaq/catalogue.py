"""The logging program's knowledge of the robot: names, values and errors of its master table."""

from __future__ import annotations

import fnmatch
import functools
import math

from ranger_sim import datatable
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.model import Variable
from ranger_sim.datatable.packing import value_of_word, word_of_value
from ranger_sim.datatable.parameters import find, rows
from ranger_sim.foundation.user_error import UserError


@functools.cache
def error_texts() -> dict[int, tuple[str, str]]:
    """Name and description of every error code."""
    return {row.id: (row.name, row.description) for row in datatable.load().errors}


def match(pattern: str) -> list[Variable]:
    """The variable of this name, or all that a pattern with * or ? fits."""
    if not any(mark in pattern for mark in "*?["):
        return [find(pattern)]
    found = [row for name, row in rows().items() if fnmatch.fnmatchcase(name, pattern)]
    if not found:
        raise UserError(f"{pattern!r}: fits no variable")
    return found


def value_of(number: int, word: int) -> float | int:
    """The number that a point's word encodes."""
    return value_of_word(all_variables.TYPES[number], word)


def text_of(number: int, word: int) -> str:
    """The shortest decimal that converts back to the same word."""
    value = value_of(number, word)
    if all_variables.TYPES[number] != "f32":
        return str(value)
    if not math.isfinite(value):
        return repr(value)
    shortest = next(n for d in range(1, 10) if word_of_value("f32", n := float(f"{value:.{d}g}")) == word)
    return repr(shortest).removesuffix(".0")
