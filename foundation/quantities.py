"""Parse and print quantities as people write them: 60s, 1.5 km, 1mm, 70 %, 450 us."""

import math
import numbers
import re
from collections.abc import Callable, Mapping

from ranger_sim.foundation.user_error import UserError

LENGTHS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "km": 1e3}
ENERGIES_WH = {"Wh": 1.0, "kWh": 1e3}
SHARES = {"%": 1e-2}
ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0}
Unit = float | Callable[[float], float]  # how many of the base unit, or how a number becomes the base unit
SLOPES: dict[str, Unit] = {**ANGLES, "%": lambda percent: math.atan(percent / 100.0)}
TIMES = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}


def _per(unit_s: float) -> Unit:
    """How a time of this unit between two becomes their rate in Hz."""
    return lambda time: 1.0 / (time * unit_s) if time else math.inf


RATES_HZ: dict[str, Unit] = {  # as a frequency, or as the time from one to the next
    "Hz": 1.0,
    "kHz": 1e3,
    "MHz": 1e6,
    **{unit: _per(size) for unit, size in TIMES.items()},
}

Duration = str | float  # "20 ms", or a number of seconds

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


def in_base_units(text: str, units: Mapping[str, Unit]) -> float | None:
    """A number with an optional unit of `units`, in that unit's base; None when `text` is not one."""
    match = re.fullmatch(rf"\s*({NUMBER})\s*([a-zA-Z%]*)\s*", text, re.ASCII)
    if match is None or match.group(2) not in {"", *units}:
        return None
    value, unit = float(match.group(1)), units.get(match.group(2), 1.0)
    return unit(value) if callable(unit) else value * unit


def nanoseconds(duration: str, what: str = "duration") -> int:
    """`duration` ("450 us", "50 ms", "2 s") in whole ns; the unit is required. UserError names `what` otherwise."""
    value = in_base_units(duration, TIMES) if isinstance(duration, str) else None
    if value is None or not re.search(r"[a-z]\s*$", duration) or not math.isfinite(value):
        raise UserError(f"{what} {duration!r}: a number with one of the units {', '.join(TIMES)} is needed")
    if value < 0.0:
        raise UserError(f"{what} {duration!r}: it must not be below 0")
    return round(value * 1e9)


def duration_ns(duration: Duration, what: str = "duration") -> int:
    """`duration`, as "20 ms" or as a number of seconds, in whole ns. UserError names `what` for anything else."""
    if isinstance(duration, str) and re.search(r"[a-z]\s*$", duration):
        seconds = in_base_units(duration, TIMES)
    elif isinstance(duration, numbers.Real) and not isinstance(duration, bool):
        seconds = float(duration)
    else:
        seconds = None
    if seconds is None or not math.isfinite(seconds) or seconds < 0.0:
        raise UserError(
            f"{what} {duration!r}: a time from 0 on is needed, as text such as '20 ms' (units {', '.join(TIMES)}) or "
            "as a number of seconds"
        )
    return round(seconds * 1e9)


def given_text(duration: Duration) -> str:
    """A duration as written, or with its unit when it is a number of seconds."""
    return duration if isinstance(duration, str) else duration_text(duration_ns(duration))


def duration_text(time_ns: float) -> str:
    """A duration in the most readable unit: 12.5 us, 3 ms, 1.25 s."""
    for unit, size in (("s", 1e9), ("ms", 1e6), ("us", 1e3)):
        if abs(time_ns) >= size:
            return f"{time_ns / size:.6g} {unit}"
    return f"{time_ns:.6g} ns"
