"""LabVIEW's measurement files (.lvm): a header of the file, then one of each segment, and its columns.

Source: National Instruments' "Specification for the LabVIEW Measurement File (.lvm)". A segment has no column of
stamps, one for all channels, or one for each (X_Columns), counted from its own start (Date, Time, X0, Delta_X).
"""

import array
import dataclasses
import pathlib
from collections.abc import Mapping

import numpy as np

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid.dataset import Dataset, Finding, Loss
from ranger_sim.sysid.readers import columns, numerals, stamps, text_file

BEGINNING = b"LabVIEW Measurement"
END_OF_HEADER = "***End_of_Header***"
SEPARATORS = {"tab": "\t", "comma": ","}
NO_STAMPS, ONE_COLUMN, COLUMN_EACH = "no", "one", "multi"  # X_Columns
FEWEST_PARTS = 2


@dataclasses.dataclass
class _Samples:
    """What was read of a channel."""

    unit: str = ""
    time_s: array.array = dataclasses.field(default_factory=lambda: array.array("d"))
    value: array.array = dataclasses.field(default_factory=lambda: array.array("d"))
    odd: int = 0
    first_odd: tuple[int, str] = (0, "")


class _Reader:
    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.separator, self.mark, self.x_columns = "\t", "", ONE_COLUMN
        self.lines: dict[str, int] = {}
        self.header: dict[str, list[str]] = {}
        self.channels: dict[str, _Samples] = {}
        self.names: list[str] = []  # of the segment
        self.ragged: list[int] = []
        self.begin_ns: int | None = None  # of the first segment
        self.offsets_s: list[float] = []
        self.x0: list[float] = []
        self.steps_s: list[float] = []
        self.row = 0
        self.promised = 0  # samples of the segment, by its header
        self.missing = 0
        self.state = "header of the file"

    @property
    def has_rows(self) -> bool:
        """True among the rows of a segment."""
        return self.state == "rows" and self.row > 0

    def count(self, what: str) -> None:
        self.lines[what] = self.lines.get(what, 0) + 1

    def take(self, number: int, line: str) -> None:
        """The next line."""
        stripped = line.strip()
        cells = [cell.strip() for cell in line.split(self.separator)]
        if self.state == "rows" and stripped and cells[0] in ("Channels", "Notes", "Test_Name", "UUT_S/N"):
            self.end_of_segment()
            self.state = "header of a segment"
        if not stripped.strip(self.separator):
            self.count("empty")
        elif self.state.startswith("header"):
            self._header_line(number, cells)
        elif self.state == "names":
            self._names_line(number, cells)
        else:
            self._data_line(number, cells)

    def _header_line(self, number: int, cells: list[str]) -> None:
        self.count("header")
        key = cells[0]
        if key.startswith("Separator") and len(cells) < FEWEST_PARTS:  # the separator is not known yet
            key, *rest = key.split(",")
            cells = [key, *rest]
        if key == END_OF_HEADER:
            self.state = "header of a segment" if self.state == "header of the file" else "names"
            return
        self.header[key] = cells[1:]
        value = next((cell for cell in cells[1:] if cell), "")
        if key == "Separator":
            self.separator = SEPARATORS.get(value.lower(), "\t")
        elif key == "Decimal_Separator":
            self.mark = value
        elif key == "X_Columns":
            self.x_columns = value.lower()
            if self.x_columns not in (NO_STAMPS, ONE_COLUMN, COLUMN_EACH):
                raise DataError(f"{self.path}:{number}: X_Columns is {value!r}; No, One or Multi is expected")

    def _names_line(self, number: int, cells: list[str]) -> None:
        self.count("names")
        if cells[0] != "X_Value":
            raise DataError(f"{self.path}:{number}: a row with X_Value and the names of the channels is expected here")
        each = self.x_columns == COLUMN_EACH
        body = cells[:-1] if cells[-1] in ("Comment", "") else cells
        self.names = body[1::2] if each else body[1:]
        self.names = [name for name in self.names if name]
        spread = 2 if each else 1
        self._of_segment(number, spread)
        for place, name in enumerate(self.names):
            units = self.header.get("Y_Unit_Label", [])[::spread]
            self.channels.setdefault(name, _Samples()).unit = units[place] if place < len(units) else ""
        self.state, self.row = "rows", 0

    def _of_segment(self, number: int, spread: int) -> None:
        """Starts and steps of the segment's channels."""
        dimension = next((cell for cell in self.header.get("X_Dimension", []) if cell), "Time")
        if dimension.lower() != "time":
            raise DataError(f"{self.path}:{number}: its channels are over {dimension}, not over time")
        numbers = self.header.get("X0", []) + self.header.get("Delta_X", [])
        self.mark = self.mark or ("," if any("," in cell for cell in numbers) else ".")

        def each(key: str, otherwise: str) -> list[str]:
            given = [cell for cell in self.header.get(key, [])[::spread]]
            return [cell or otherwise for cell in given + [otherwise] * len(self.names)][: len(self.names)]

        self.x0 = [numerals.value_of(cell, self.mark) for cell in each("X0", "0")]
        self.steps_s = [numerals.value_of(cell, self.mark) for cell in each("Delta_X", "0")]
        self.offsets_s = []
        for date, time in zip(each("Date", ""), each("Time", ""), strict=True):
            found = stamps.both_ways([f"{date} {time.replace(',', '.')[:18]}"], stamps.Forms()) if date else None
            at_ns = int(found[0][0]) if found is not None else None
            self.begin_ns = at_ns if self.begin_ns is None else self.begin_ns
            known = at_ns is not None and self.begin_ns is not None and at_ns != stamps.NONE
            self.offsets_s.append((at_ns - self.begin_ns) * 1e-9 if known else 0.0)  # type: ignore[operator]
        samples = [cell for cell in self.header.get("Samples", []) if cell.isdecimal()]
        self.promised = max(map(int, samples), default=0)

    def _data_line(self, number: int, cells: list[str]) -> None:
        count = len(self.names)
        most = (2 * count if self.x_columns == COLUMN_EACH else count + 1) + 1  # and a remark
        if len(cells) > most and any(cells[most:]):
            self.ragged.append(number)
            self.row += 1
            return
        self.count("rows")
        for place, name in enumerate(self.names):
            at = 2 * place + 1 if self.x_columns == COLUMN_EACH else place + 1
            cell = cells[at] if at < len(cells) else ""
            if not cell:
                continue
            if self.x_columns == NO_STAMPS:
                x = self.x0[place] + self.row * self.steps_s[place]
            else:
                x = numerals.value_of(cells[at - 1 if self.x_columns == COLUMN_EACH else 0], self.mark)
            samples = self.channels[name]
            value = numerals.value_of(cell, self.mark)
            if value != value and cell.lower().strip("+-") != "nan":
                samples.odd += 1
                samples.first_odd = samples.first_odd if samples.odd > 1 else (number, cell)
            samples.time_s.append(self.offsets_s[place] + x)
            samples.value.append(value)
        self.row += 1

    def end_of_segment(self) -> None:
        """Samples that the segment should have; a file of one header goes on behind them."""
        self.missing += max(0, self.promised - self.row)


def read(path: pathlib.Path, mapping: Mapping[str, str] | None = None) -> Dataset:
    """The channels of a file. UserError for one that does not follow the specification."""
    mapping = dict(mapping or {})
    survey = text_file.survey(path)
    reader = _Reader(path)
    last = ""
    for first, lines in text_file.chunks(path, survey.encoding):
        for number, line in enumerate(lines, first):
            if last:
                reader.take(number - 1, last)
            last = line or "\n"
    if survey.ends or not reader.has_rows:  # a row without a line end may be cut off in a number
        reader.take(number, last)
    else:
        reader.lines["left out: cut off"] = 1
        reader.missing += reader.row >= reader.promised
    reader.end_of_segment()
    if not reader.channels:
        raise DataError(f"{path}: it has no segment with names of channels")
    dataset = Dataset(path.name, {}, lines=reader.lines)
    kept = reader.lines.get("rows", 0)
    dataset.rows = kept + len(reader.ragged) + reader.missing
    lost: tuple[Loss, ...] = ()
    if reader.ragged:
        dataset.lines["left out: ragged"] = len(reader.ragged)
        lost += (Loss("ragged", len(reader.ragged), f"in line {reader.ragged[0]}"),)
        text = f"{len(reader.ragged)} rows have too many cells and are left out (line {reader.ragged[0]} ...)"
        dataset.findings.append(Finding("", "ragged", 0.0, 0.0, float(len(reader.ragged)), "rows", text))
    if reader.missing:
        lost += (Loss("cut_off", reader.missing, "at the end of a segment"),)
        text = f"{reader.missing} rows are missing: the headers say so many samples more"
        dataset.findings.append(Finding("", "cut_off", 0.0, 0.0, float(reader.missing), "rows", text))
    columns.check_mapping(dataset, mapping, list(reader.channels))
    for name, samples in reader.channels.items():
        time_s, value = np.array(samples.time_s), np.array(samples.value)
        named = columns.label(dataset.name, name, samples.unit, mapping)
        if samples.odd:
            place, cell = samples.first_odd
            text = f"{samples.odd} cells are not numbers, the first in line {place}: {cell[:30]!r}"
            ends = columns.ends(time_s)
            dataset.findings.append(Finding(named.name, "unreadable", *ends, float(samples.odd), "samples", text))
        if not np.isfinite(value).any():
            text = "it has no number in it, left out"
            dataset.findings.append(Finding(named.name, "empty", 0.0, 0.0, 0.0, "", text, "note"))
            continue
        columns.add(dataset, name, named, time_s, value, losses=lost)
    dataset.layout = {"columns": list(reader.channels), "time": f"X_Columns {reader.x_columns}"}
    return dataset
