"""Values typed on a command line (60s, 1.5km, 1mm, 70 %, 1e6): the only module that reads and limits them.

Each kind of value is an argparse type. Its errors contain the text as typed and the limit; argparse puts the option's
name in front. `text(value)` writes a value so that it is read back as the very same number.
"""

import argparse
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from ranger_sim.foundation.quantities import (
    ANGLES,
    ENERGIES_WH,
    LENGTHS,
    NUMBER,
    RATES_HZ,
    SHARES,
    SLOPES,
    TIMES,
    Unit,
    in_base_units,
)

__all__ = [
    "ANGLES",
    "ENERGIES_WH",
    "LENGTHS",
    "SHARES",
    "SLOPES",
    "TIMES",
    "OrAll",
    "Quantity",
    "Value",
    "WholeNumber",
    "Word",
]
__all__ += ["RATES_HZ", "Unit", "duration_text", "figure", "length_text", "number", "quantity", "whole_number", "word"]

# Text of this form is a value, not an option: so `--time -1s` reaches its check (`-1` alone would by default).
NEGATIVE_VALUE = re.compile(r"-(\.?\d|inf|nan)", re.IGNORECASE)
SHOWN = 60  # letters of a typed text that a message repeats; chosen by us


class Value(Protocol):
    """One kind of value of the command line."""

    def __call__(self, text: str) -> Any:
        """The value; argparse.ArgumentTypeError describes an error in the text."""

    def text(self, value: Any) -> str:
        """What to type for this value."""


def as_typed(text: str) -> str:
    """A typed text for a message, cut to SHOWN letters."""
    return repr(text if len(text) <= SHOWN else f"{text[:SHOWN]}...")


@dataclass(frozen=True, eq=False)  # argparse needs its hash, and a dict has none
class Quantity:
    """A number with an optional unit of `units`, in SI; `base` names the unit of a number without one.

    above: exclusive lower limit; least, most: inclusive ones. Infinities and NaN are always refused.
    """

    units: Mapping[str, Unit] = field(default_factory=dict)
    base: str = ""
    above: float | None = None
    least: float | None = None
    most: float | None = None

    def __call__(self, text: str) -> float:
        value = in_base_units(text, self.units)
        if value is None:
            kinds = f"a number with one of the units {', '.join(self.units)} (none means {self.base})"
            raise argparse.ArgumentTypeError(f"{as_typed(text)} is not {kinds if self.units else 'a number'}")
        if not (
            math.isfinite(value)
            and (self.above is None or value > self.above)
            and (self.least is None or value >= self.least)
            and (self.most is None or value <= self.most)
        ):
            raise argparse.ArgumentTypeError(f"{as_typed(text)} must be {self.limits()}")
        return value

    def limits(self) -> str:
        """The allowed values in words."""
        named = (("above", self.above), ("at least", self.least), ("at most", self.most))
        parts = [f"{name} {limit:g} {self.base}".rstrip() for name, limit in named if limit is not None]
        return " and ".join(parts) or "finite"

    def text(self, value: float) -> str:
        """Digits that are read back as the very same number; with the unit if 1 of it is 1 in SI."""
        return f"{value!r}{next((unit for unit, size in self.units.items() if size == 1.0), '')}"


@dataclass(frozen=True)
class OrAll:
    """A quantity, or the word `all`, which is infinity."""

    quantity: Quantity

    def __call__(self, text: str) -> float:
        return math.inf if text.strip() == "all" else self.quantity(text)

    def text(self, value: float) -> str:
        """Its digits, or `all`."""
        return "all" if math.isinf(value) else self.quantity.text(value)


@dataclass(frozen=True)
class WholeNumber:
    """A whole number from `least` to `most`; 1e6 is one."""

    least: int | None = None
    most: int | None = None

    def __call__(self, text: str) -> int:
        value = self._read(text.strip())
        if value is None:
            raise argparse.ArgumentTypeError(f"{as_typed(text)} is not a whole number")
        if self.least is not None and value < self.least:
            raise argparse.ArgumentTypeError(f"{as_typed(text)} is below {self.least}")
        if self.most is not None and value > self.most:
            raise argparse.ArgumentTypeError(f"{as_typed(text)} is above {self.most}")
        return value

    @staticmethod
    def _read(text: str) -> int | None:
        if re.fullmatch(r"[-+]?\d{1,4000}", text, re.ASCII):  # Python itself reads no more than 4300 digits
            return int(text)
        if re.fullmatch(NUMBER, text, re.ASCII):
            value = float(text)
            return int(value) if value.is_integer() and abs(value) < 2**53 else None
        return None

    def text(self, value: int) -> str:
        """Its digits."""
        return str(value)


@dataclass(frozen=True)
class Word:
    """A name or a path: any text but the empty one. `what`: its name in the error for an empty text."""

    what: str

    def __call__(self, text: str) -> str:
        if not text:
            raise argparse.ArgumentTypeError(f"'' is empty: {self.what} is expected")
        return text

    def text(self, value: str) -> str:
        """Itself."""
        return value


def quantity(
    units: Mapping[str, Unit],
    base: str,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
) -> Quantity:
    """A number with an optional unit of `units`."""
    return Quantity(units, base, above, least, most)


def number(above: float | None = None, least: float | None = None, most: float | None = None) -> Quantity:
    """A number without a unit."""
    return Quantity({}, "", above, least, most)


def whole_number(least: int | None = None, most: int | None = None) -> WholeNumber:
    """A whole number."""
    return WholeNumber(least, most)


def word(what: str) -> Word:
    """A name or a path."""
    return Word(what)


def figure(value: float | None, form: str) -> str:
    """A figure formatted by `form` ("{:.3f} m"); "none" for None."""
    return "none" if value is None else form.format(value)


def length_text(length_m: float) -> str:
    """Metres, from 1 km up kilometres."""
    return f"{length_m:.2f} m" if length_m < 1000.0 else f"{length_m / 1000.0:.3f} km"


def duration_text(seconds: float) -> str:
    """Seconds, from an hour up also hours and minutes."""
    whole = round(seconds / 60.0)
    return f"{seconds:.1f} s" + (f" ({whole // 60} h {whole % 60:02d} min)" if seconds >= 3600.0 else "")
