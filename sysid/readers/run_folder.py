"""The folder that `ranger-sim walk` leaves: variables.mf4, and in summary.json how the walk ended."""

import pathlib
from collections.abc import Mapping
from typing import Any

from ranger_sim.foundation import json_text
from ranger_sim.foundation.user_error import DataError, printable
from ranger_sim.sysid.dataset import Dataset, Finding
from ranger_sim.sysid.readers import measurement

VARIABLES, SUMMARY = "variables.mf4", "summary.json"


def read(path: str | pathlib.Path, mapping: Mapping[str, str] | None = None, truth: bool = False) -> Dataset:
    """The variables that the boards knew, named like the folder; that the robot fell is a finding."""
    dataset = variables(path, mapping, truth)
    try:
        summary = json_text.loads((pathlib.Path(path) / SUMMARY).read_bytes(), SUMMARY)
    except (OSError, json_text.JsonError):
        text = f"{SUMMARY} is missing or cannot be read: how the walk ended is not known"
        dataset.findings.append(Finding("", "no_summary", 0.0, 0.0, 0.0, "", text, "note"))
        return dataset
    if isinstance(summary, dict):
        note_end(dataset, summary)
    return dataset


def variables(path: str | pathlib.Path, mapping: Mapping[str, str] | None = None, truth: bool = False) -> Dataset:
    """The variables alone, also of a folder whose walk has no summary yet."""
    folder = pathlib.Path(path)
    if not (folder / VARIABLES).is_file():
        raise DataError(f"{folder}: this is not a folder of a walk, it has no {VARIABLES} (walk --log decides)")
    dataset = measurement.read(folder / VARIABLES, mapping, truth)
    dataset.name = printable(folder.resolve().name)
    return dataset


def note_end(dataset: Dataset, summary: Mapping[str, Any]) -> None:
    """Add to the findings that the robot fell, if it did by the walk's summary."""
    if summary.get("fell"):
        ends = max((float(channel.time_s[-1]) for channel in dataset.channels.values()), default=0.0)
        text = f"the robot fell ({summary.get('fall_cause') or 'no cause given'}): the last step is not walking"
        dataset.findings.append(Finding("", "fell", ends, ends, 1.0, "", text))
