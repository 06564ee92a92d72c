"""A column in every reader: its name, its unit, its conversion to SI, and a note of each change."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid import units
from ranger_sim.sysid.dataset import Array, Channel, Dataset, Finding, Loss, Repair
from ranger_sim.sysid.units import Unit

EPOCH_S = 1e8  # stamps beyond this (three years) are of a calendar; floats would resolve them to 0.2 us only


@dataclasses.dataclass(frozen=True)
class Label:
    """Name of a column in SI, with its unit; the unit is None when nothing gives it.

    unknown: the file's text for an unknown unit, where nothing else gives the unit.
    """

    name: str
    unit: Unit | None
    unknown: str = ""


def mapping_of(texts: list[str]) -> dict[str, str]:
    """`old=new` pairs as a mapping. UserError for anything else, and for a column named twice."""
    found: dict[str, str] = {}
    for text in texts:
        old, equals, new = text.partition("=")
        old, new = old.strip(), new.strip()
        if not equals or not old or not new:
            raise DataError(f"--map {text!r}: old=new is expected, as in --map MCH_ANGLE=hip_angle_rad")
        if old in found:
            raise DataError(f"--map {text!r}: {old} is named already, it became {found[old]}")
        found[old] = new
    return found


def label(source: str, column: str, unit_text: str | None, mapping: Mapping[str, str]) -> Label:
    """Name and unit of a column. `unit_text`: the file's unit outside the name, None when absent.

    The file's unit overrides the name's, and both override that of the name in `mapping`. UserError when that one is of
    another kind.
    """
    stem, unit = units.split(column)
    in_name = unit is not None
    said = units.unit_of(unit_text) if unit_text is not None and unit_text.strip() else None
    if said is not None:
        unit, in_name = said, unit is not None and said.same_kind(unit)
        stem = stem if in_name else "_".join(column.split())
    given = mapping.get(column)
    if given is not None:
        stem, new_unit = units.split(given)
        in_name = new_unit is not None
        unit = unit if unit is not None else new_unit
        if unit is not None and new_unit is not None and not unit.same_kind(new_unit):
            raise DataError(
                f"{source}: {column} is in {unit.text or 'parts of one'}, it cannot become {given} "
                f"({new_unit.text or 'parts of one'})"
            )
    unknown = unit_text.strip() if unit is None and unit_text is not None else ""
    return Label(units.si_name(stem, unit) if in_name and unit is not None else stem, unit, unknown)


def add(
    dataset: Dataset,
    column: str,
    named: Label,
    time_s: Array,
    value: Array,
    resolution: float = 0.0,
    losses: tuple[Loss, ...] = (),
) -> None:
    """Put a column into the dataset, in SI, and record the changes there. losses: samples that were read and left
    out."""
    if named.name in dataset.channels:
        raise DataError(f"{dataset.name}: two columns would be called {named.name}; --map gives one another name")
    unit = named.unit
    if named.unknown:
        text = f"its unit {named.unknown[:40]!r} is not known (--map {column}=NAME_UNIT says it)"
        dataset.findings.append(Finding(named.name, "unknown_unit", *ends(time_s), 0.0, "", text))
    elif unit is None:
        text = "nothing says its unit" if column == named.name else f"{column}: nothing says its unit"
        dataset.findings.append(Finding(named.name, "no_unit", *ends(time_s), 0.0, "", text, "note"))
    elif not unit.is_si:
        value = value * unit.factor + unit.offset
        offset = f" {unit.offset:+g}" if unit.offset else ""
        text = f"{column}: times {unit.factor:.10g}{offset}, now in {unit.text or 'parts of one'}"
        dataset.repairs.append(Repair(named.name, "si_unit", len(value), text))
    if named.name != column and (unit is None or unit.is_si):
        dataset.repairs.append(Repair(named.name, "renamed", 0, f"{column} is called {named.name}"))
    factor = unit.factor if unit is not None else 1.0
    dataset.channels[named.name] = Channel(
        named.name, unit.text if unit is not None else "", time_s, value, abs(factor) * resolution, column, losses
    )


def ends(time_s: Array) -> tuple[float, float]:
    """First and last stamp that is a number; zeros when there is none."""
    finite = time_s[np.isfinite(time_s)]
    return (float(finite[0]), float(finite[-1])) if len(finite) else (0.0, 0.0)


def from_zero(dataset: Dataset, time_s: Array) -> Array:
    """Stamps of a calendar counted from the first of them, and a note of it; others unchanged."""
    finite = time_s[np.isfinite(time_s)]
    if not len(finite) or finite[0] < EPOCH_S:
        return time_s
    dataset.repairs.append(
        Repair("", "clock_zero", len(time_s), f"{finite[0]:.6f} s subtracted from all stamps, so that they begin at 0")
    )
    return time_s - finite[0]


def check_mapping(dataset: Dataset, mapping: Mapping[str, str], columns: list[str]) -> None:
    """UserError for a column that `mapping` names and the file does not have."""
    for old in mapping:
        if old not in columns:
            raise DataError(f"{dataset.name}: --map {old}=...: unknown column (available: {', '.join(columns)})")
