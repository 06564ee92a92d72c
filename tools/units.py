"""Quantities as people type them on a command line: 60s, 1.5km, 1mm, 70%."""

import argparse
import math
from collections.abc import Callable

from ranger_sim.foundation.quantities import ENERGIES_WH, LENGTHS, SHARES, TIMES, in_base_units

__all__ = ["ENERGIES_WH", "LENGTHS", "SHARES", "TIMES", "quantity", "whole_number"]


def quantity(units: dict, base: str, above: float | None = None) -> Callable[[str], float]:
    """An argparse type: a number with an optional unit of `units`, in SI. `above`: exclusive lower limit."""

    def parse(text: str) -> float:
        value = in_base_units(text, units)
        if value is None:
            raise argparse.ArgumentTypeError(
                f"{text!r} is not a number with one of the units {', '.join(units)} (none means {base})"
            )
        if not math.isfinite(value) or (above is not None and value <= above):
            raise argparse.ArgumentTypeError(f"{text!r} must be above {above:g} {base}")
        return value

    return parse


def whole_number(low: int) -> Callable[[str], int]:
    """An argparse type: a whole number of at least `low`."""

    def parse(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None
        if value < low:
            raise argparse.ArgumentTypeError(f"{value} is below {low}")
        return value

    return parse
