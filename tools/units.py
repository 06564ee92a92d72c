"""Quantities as people type them on a command line: 60s, 1.5km, 1mm, 70%."""

import argparse
import math
import re
from collections.abc import Callable

LENGTHS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "km": 1e3}
ENERGIES_WH = {"Wh": 1.0, "kWh": 1e3}
SHARES = {"%": 1e-2}
TIMES = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}


def quantity(units: dict, base: str, above: float | None = None) -> Callable[[str], float]:
    """An argparse type: a number with an optional unit of `units`, in SI. `above`: exclusive lower limit."""

    def parse(text: str) -> float:
        match = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([a-zA-Z%]*)\s*", text)
        if match is None or match.group(2) not in {"", *units}:
            raise argparse.ArgumentTypeError(
                f"{text!r} is not a number with one of the units {', '.join(units)} (none means {base})"
            )
        value = float(match.group(1)) * units.get(match.group(2), 1.0)
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
