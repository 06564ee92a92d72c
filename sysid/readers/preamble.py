"""What oscilloscopes and loggers write above a table: the sampling, units and names of its columns."""

import dataclasses
import re
from collections.abc import Sequence

from ranger_sim.sysid import units
from ranger_sim.sysid.readers import numerals

INTERVAL = ("sample interval", "sampling interval", "sample period", "increment", "hresolution", "time step")
RATE = ("sample rate", "sampling rate", "samplerate", "sampling frequency", "sample frequency", "abtastrate")
TIME_UNIT = ("horizontal units", "hunit")
UNITS = ("vertical units", "vunit")
NAMES = ("tracename",)
RATES = {"": 1.0, "hz": 1.0, "khz": 1e3, "mhz": 1e6, "s/s": 1.0, "sa/s": 1.0, "ks/s": 1e3}


@dataclasses.dataclass(frozen=True)
class Preamble:
    """step_s: of the samples, 0 unknown; the others are empty where unknown."""

    step_s: float = 0.0
    time_unit: str = ""
    units: tuple[str, ...] = ()
    names: tuple[str, ...] = ()


def of(rows: Sequence[Sequence[str]]) -> Preamble:
    """The meaning of the rows above the data, as cells."""
    step_s, time_unit = 0.0, ""
    unit_texts: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    for place, cells in enumerate(rows):
        key, rest = _parts(cells)
        if key in NAMES and rest:
            names = tuple(rest)
        elif key in UNITS and rest:
            unit_texts = tuple(each.rpartition(":")[2].strip() for each in rest)
        elif key in TIME_UNIT and rest:
            time_unit = rest[0]
        elif key in INTERVAL and rest:
            step_s = _interval(rest[0]) or step_s
        elif key in RATE and rest:
            rate = _rate(" ".join(rest[:2]))
            step_s = 1.0 / rate if rate > 0.0 else step_s
        elif "increment" in (lowered := [cell.lower() for cell in cells]) and place + 1 < len(rows):
            below, column = rows[place + 1], lowered.index("increment")
            step_s = _interval(below[column]) if column < len(below) else step_s
    return Preamble(step_s, time_unit, unit_texts, names)


def _parts(cells: Sequence[str]) -> tuple[str, list[str]]:
    """(key in small letters, values) of a row; `key: value` in one cell is taken apart."""
    if not cells:
        return "", []
    key, colon, value = cells[0].lstrip("#%/; ").partition(":")
    if not colon:
        key, colon, value = cells[0].lstrip("#%/; ").partition("=")
    rest = [each for each in ([value.strip()] if colon else []) + [cell.strip() for cell in cells[1:]] if each]
    return key.strip().lower(), rest


def _interval(text: str) -> float:
    found = re.fullmatch(r"(?:\w+:)?([-+\d.,eE]+)\s*(.*)", text.strip())
    if found is None:
        return 0.0
    unit = units.unit_of(found[2]) if found[2] else None
    step_s = numerals.value_of(found[1], "," if "," in found[1] else ".") * (unit.factor if unit is not None else 1.0)
    return step_s if step_s > 0.0 else 0.0


def _rate(text: str) -> float:
    found = re.match(r"(?:\w+:)?([-+\d.,eE]+)\s*([A-Za-z/]*)", text.strip())
    if found is None or found[2].lower() not in RATES:
        return 0.0
    rate = numerals.value_of(found[1], "," if "," in found[1] else ".") * RATES[found[2].lower()]
    return rate if rate > 0.0 else 0.0
