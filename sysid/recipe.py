"""Import recipes: how the files of one laboratory are read, as TOML, so that the next ones are read the same way.

format = "text table"
columns = ["Zeit", "Strom [mA]"]
[assume]
separator = "semicolon"
[map]
Strom = "current_mA"
"""

import dataclasses
import json
import pathlib
import re
from typing import Any

from ranger_sim.foundation import quantities, toml_file
from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.readers import layout

KEYS = {"format": str, "columns": list, "channels": dict, "time_unit": str, "rate": str, "dbc": list,
        "bus": list, "assume": dict, "map": dict}  # fmt: skip
MOST_NAMED = 5
NOT_OF_THE_NEXT = ("names",)  # a line number: preambles differ in length, the names are found by themselves


@dataclasses.dataclass(frozen=True)
class Recipe:
    """How a file was read. columns: the file's names of a text table; channels: {name: unit} of the result.

    assume: as `--assume`; rate_hz: of the samples, None where the file has stamps; databases: DBC files; name: of the
    recipe's file, for messages.
    """

    format: str
    channels: dict[str, str]
    columns: tuple[str, ...] = ()
    assume: dict[str, str] = dataclasses.field(default_factory=dict)
    mapping: dict[str, str] = dataclasses.field(default_factory=dict)
    time_unit: str | None = None
    rate_hz: float | None = None
    databases: tuple[str, ...] = ()
    buses: tuple[str, ...] = ()
    name: str = "recipe"

    @classmethod
    def of(cls, dataset: Dataset, time_unit: str | None = None) -> "Recipe":
        """The recipe of a dataset as it was read."""
        how = dataset.layout
        return cls(
            str(how.get("format", "")),
            {name: channel.unit for name, channel in dataset.channels.items()},
            tuple(how.get("columns", ())),
            {key: str(how[key]) for key in layout.KEYS if key in how and key not in NOT_OF_THE_NEXT and key != "time"},
            dict(how.get("map", {})),
            time_unit,
            how.get("rate_hz"),
            tuple(how.get("dbc", ())),
            tuple(how.get("bus", ())),
        )

    @classmethod
    def load(cls, path: str | pathlib.Path) -> "Recipe":
        """The recipe of a file. UserError for an unknown key, or a value of another type."""
        path = pathlib.Path(path)
        table = toml_file.load(path, "an import recipe")
        for key, value in table.items():
            if key not in KEYS:
                raise DataError(f"{path}: unknown key {key!r} (available: {', '.join(KEYS)})")
            kind = KEYS[key]
            if not isinstance(value, kind):
                raise DataError(f"{path}: {key} is {type(value).__name__}, {kind.__name__} is expected")
        assume = layout.assumptions([f"{key}={value}" for key, value in table.get("assume", {}).items()])
        return cls(
            table.get("format", ""),
            dict(table.get("channels", {})),
            tuple(table.get("columns", ())),
            assume,
            {key: str(value) for key, value in table.get("map", {}).items()},
            table.get("time_unit"),
            _rate_hz(path, table["rate"]) if "rate" in table else None,
            tuple(table.get("dbc", ())),
            tuple(table.get("bus", ())),
            str(path),
        )

    def text(self) -> str:
        """The recipe as TOML."""
        lines = [
            "# How the files of this kind are read: ranger-sim read FILE --recipe THIS",
            f"format = {_toml(self.format)}",
        ]
        for key, value in (
            ("columns", list(self.columns)),
            ("time_unit", self.time_unit),
            ("rate", f"{self.rate_hz!r} Hz" if self.rate_hz else None),
            ("dbc", list(self.databases)),
            ("bus", list(self.buses)),
        ):
            if value:
                lines.append(f"{key} = {_toml(value)}")
        for title, mapping in (("assume", self.assume), ("map", self.mapping), ("channels", self.channels)):
            if mapping:
                lines += ["", f"[{title}]", *(f"{_key(key)} = {_toml(value)}" for key, value in mapping.items())]
        return "\n".join(lines) + "\n"

    def check(self, dataset: Dataset) -> None:
        """UserError with the difference when a dataset is not what the recipe describes."""
        differences = []
        if self.format and dataset.layout.get("format") != self.format:
            differences.append(f"it is {dataset.layout.get('format')}, not {self.format}")
        if self.columns:
            differences += _difference("columns", list(self.columns), list(dataset.layout.get("columns", ())))
        if self.channels:
            there = {name: channel.unit for name, channel in dataset.channels.items()}
            if not self.columns:
                differences += _difference("channels", list(self.channels), list(there))
            differences += [
                f"{name} is in {there[name] or 'no unit'}, not in {unit or 'no unit'}"
                for name, unit in self.channels.items()
                if name in there and there[name] != unit
            ][:MOST_NAMED]
        if differences:
            raise DataError(f"{dataset.name}: it does not fit {self.name}: {'; '.join(differences)}")


def _rate_hz(path: pathlib.Path, text: str) -> float:
    rate_hz = quantities.in_base_units(text, quantities.RATES_HZ)
    if rate_hz is None or not 0.0 < rate_hz < float("inf"):
        units = ", ".join(quantities.RATES_HZ)
        raise DataError(f"{path}: rate is {text!r}; a number above 0 with one of the units {units} is expected")
    return rate_hz


def _difference(what: str, wanted: list[str], there: list[str]) -> list[str]:
    missing = [each for each in wanted if each not in there]
    new = [each for each in there if each not in wanted]
    found = []
    if missing:
        found.append(f"without the {what} {', '.join(missing[:MOST_NAMED])}")
    if new:
        found.append(f"with the new {what} {', '.join(new[:MOST_NAMED])}")
    if not found and wanted != there:
        found.append(f"its {what} are in another order")
    return found


def _key(text: str) -> str:
    return text if re.fullmatch("[A-Za-z0-9_-]+", text) else _toml(text)


def _toml(value: Any) -> str:
    """A text or a list of texts as TOML, whose basic strings are JSON's but for DEL."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007F")
