"""Writable values of a running robot: the parameters of the master table, each within its limits.

The only check for all writers: `ctl set`, `Ranger.set_parameter`, `daq`, parameter sets. The robot itself applies the
same limits to data from its serial link (`all_variables.WRITABLE`, generated from the same rows).
"""

from __future__ import annotations

import functools
import math
import numbers
from typing import Any

from ranger_sim import datatable
from ranger_sim.datatable.model import COMPUTER, LIMITS, Variable
from ranger_sim.datatable.packing import word_of_value
from ranger_sim.foundation.user_error import TableError, unknown

CHANNEL_PREFIX = "LV_"  # the serial link's own variables: channels are chosen, not written
LONGEST_SHOWN = 60  # characters of a value in a message


@functools.cache
def rows() -> dict[str, Variable]:
    """Every variable by name."""
    return {row.name: row for row in datatable.load().variables}


def find(name: str) -> Variable:
    """The variable of this name; UserError with the nearest names for an unknown name."""
    row = rows().get(name)
    if row is None:
        raise TableError(unknown("variable", name[:LONGEST_SHOWN], rows()))
    return row


def is_parameter(row: Variable) -> bool:
    """True for variables that the computer publishes, which may be written."""
    return row.publisher == COMPUTER and not row.name.startswith(CHANNEL_PREFIX)


@functools.cache
def parameters() -> tuple[Variable, ...]:
    """Every parameter, in the order of the table."""
    return tuple(row for row in rows().values() if is_parameter(row))


def parameter(name: str) -> Variable:
    """The parameter of this name; UserError for any other name."""
    row = find(name)
    if row.name.startswith(CHANNEL_PREFIX):
        raise TableError(f"{name}: not a parameter; --fast and --medium set the channels of the link")
    if not is_parameter(row):
        raise TableError(f"{name}: not a parameter, it is published by {row.publisher}; the robot would refuse it")
    return row


def checked_word(row: Variable, value: Any, place: str = "") -> int:
    """The 32-bit word of a parameter's value; UserError when it is not a number, or outside its limits or its type."""
    what = f"{place}: {row.name}" if place else row.name
    number = number_of(value)
    if number is None:
        raise TableError(f"{what} = {shown(value)}: a number is expected")
    low, high = row.minimum, row.maximum
    if (low is not None and number < low) or (high is not None and number > high):
        allowed = " to ".join("no limit" if each is None else f"{each:g}" for each in (low, high))
        raise TableError(f"{what} = {number:g} is outside {allowed}{' ' + row.unit if row.unit else ''}")
    low, high = LIMITS[row.type]
    if not low <= number <= high or (row.type != "f32" and number != int(number)):
        raise TableError(f"{what} = {number:g} does not fit into its type, {row.type}")
    return word_of_value(row.type, number)


def number_of(value: Any) -> float | None:
    """`value` as a finite number; None when it is not one (nor is a truth value)."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def shown(value: Any) -> str:
    """An invalid value for a message: shortened, without terminal control characters."""
    text = ascii(value)
    return text if len(text) <= LONGEST_SHOWN else text[:LONGEST_SHOWN] + "..."
