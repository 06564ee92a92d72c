"""Text tables: a header line with names and units, one row per sample.

Accepted: a byte order mark, UTF-16, comment lines (#, %, //), a line of units below the header, separators comma,
semicolon, tab and spaces, decimal commas next to semicolons or tabs or in quotes, stamps in s, ms, us or ns, as dates
and times in one column or two (stamps.py), as times of the day, or as a spreadsheet's days. An empty cell is a time
without a sample of this channel; a cell that is not a number becomes "not a number" and a finding.
Without a header the columns are column_1, column_2 ..., and `mapping` names them.
"""

import csv
import pathlib
import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid import units
from ranger_sim.sysid.dataset import Array, Dataset, Finding, Loss, Repair
from ranger_sim.sysid.readers import columns, stamps

COMMENTS = ("#", "%", "//")
EMPTY = ("", "-", "na", "n/a", "null", "none")
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf|infinity)", re.IGNORECASE)
DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
CLOCKS = ("datetime", "date_time", "date", "utc", "datum", "uhrzeit", "clock")  # in addition to those named time
SPREADSHEET_DAYS = (20_000.0, 80_000.0)  # of the years 1954 to 2119
FASTEST_S = 2e-5  # a smaller step is not a machine's, but may be a spreadsheet's part of a day
SLOWEST_S = 0.5  # as sanity.LONGEST_STEP_S: beyond it the unit is probably a smaller one
SNIFFED_CELLS = 50
NAMED_LINES = 3  # number of a finding's places that are named
LARGEST_BYTES = 2_000_000_000
MOST_LINES = 3_000_000  # each is kept as text while it is read: some hundred bytes a line


def read(path: str | pathlib.Path, mapping: Mapping[str, str] | None = None, time_unit: str | None = None) -> Dataset:
    """The channels of a text table. mapping: {column in the file: name of the channel}; time_unit: of a time column
    whose name does not give it. UserError for a file that is not a table with a time column.
    """
    path = pathlib.Path(path)
    dataset = Dataset(path.name, {})
    lines = _lines(dataset, path)
    separator, decimal_comma = _separator(lines)
    rows = [(number, _cells(text, separator)) for number, text in lines]
    if decimal_comma:
        dataset.repairs.append(Repair("", "decimal_comma", len(rows), "decimal commas are read as points"))
    names, unit_texts, rows = _header(dataset, rows, decimal_comma)
    mapping = dict(mapping or {})
    columns.check_mapping(dataset, mapping, names)
    dataset.rows = len(rows)
    cells, lost = _grid(dataset, rows, names)
    time_columns, time_s = _time(dataset, names, unit_texts, cells, mapping, time_unit, decimal_comma)
    stamped = np.isfinite(time_s)
    if not stamped.all():
        text = f"{int((~stamped).sum())} rows have no stamp and are left out"
        dataset.repairs.append(Repair("", "no_stamp", int((~stamped).sum()), text))
        dataset.findings.append(Finding("", "no_stamp", *columns.ends(time_s), float((~stamped).sum()), "rows", text))
        lost += (Loss("no_stamp", int((~stamped).sum()), f"in line {rows[int(np.argmin(stamped))][0]}"),)
    for index, name in enumerate(names):
        if index in time_columns:
            continue
        named = columns.label(dataset.name, name, unit_texts[index], mapping)
        value, present, finest = _numbers(dataset, named.name, rows, cells[index], time_s, decimal_comma)
        kept = present & stamped
        if not np.isfinite(value[kept]).any():
            text = f"{name}: has no number in it, left out"
            dataset.findings.append(Finding(named.name, "empty", *columns.ends(time_s), 0.0, "", text))
            continue
        columns.add(dataset, name, named, time_s[kept], value[kept], finest, lost)
    if not dataset.channels:
        called = " and ".join(names[index] for index in sorted(time_columns))
        raise DataError(f"{path}: there is no channel beside the time column {called}")
    return dataset


def _lines(dataset: Dataset, path: pathlib.Path) -> list[tuple[int, str]]:
    """(line number, text) of every line that is neither empty nor a comment."""
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise DataError(f"{path}: {path.stat().st_size} bytes, a text table may have {LARGEST_BYTES}")
        content = path.read_bytes()
    except OSError as error:
        raise DataError(f"{path}: the table cannot be read ({error.strerror or error})") from None
    lines = content.count(b"\n")
    if lines > MOST_LINES:
        raise DataError(
            f"{path}: {lines} lines, a text table may have {MOST_LINES}: thin it out or split it, or use MF4 (.mf4)"
        )
    encoding = "utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        text = content.decode("latin-1")
        encoding = "latin-1"
    if "\0" in text:
        raise DataError(f"{path}: this is no text table, it has bytes of value 0")
    if encoding != "utf-8-sig":
        dataset.repairs.append(Repair("", "encoding", 0, f"the text is read as {encoding}, it is not UTF-8"))
    found = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip(" \t\r,;")]
    kept = [(number, line) for number, line in found if not line.lstrip().startswith(COMMENTS)]
    if not kept and found:  # a header behind a comment mark, as numpy writes it, and no rows
        raise DataError(f"{path}: the table has comment lines only")
    if not kept:
        raise DataError(f"{path}: the table is empty")
    behind_mark = _header_in_comment(found, kept)
    return ([behind_mark] if behind_mark else []) + kept


def _header_in_comment(found: list[tuple[int, str]], kept: list[tuple[int, str]]) -> tuple[int, str] | None:
    """The comment line just above numbers with a name for each column, as numpy.savetxt writes headers."""
    separator, _ = _separator(kept)
    first = _cells(kept[0][1], separator)
    if not all(_is_number(cell) or not cell for cell in first):
        return None
    above = [(number, line) for number, line in found if number < kept[0][0]]
    if not above:
        return None
    number, line = above[-1]
    text = line.lstrip().lstrip("#%/").strip()
    cells = _cells(text, separator)
    return (number, text) if len(cells) == len(first) and not any(map(_is_number, cells)) else None


def _separator(lines: list[tuple[int, str]]) -> tuple[str, bool]:
    """(separator, True when numbers have decimal commas) of a table, by its first rows."""
    some = [line for _, line in lines[:50]]
    for separator in ("\t", ";"):
        if all(separator in line for line in some):
            cells = [cell.strip() for line in some[1:] or some for cell in line.split(separator)]
            commas = sum(bool(DECIMAL_COMMA.fullmatch(cell)) for cell in cells)
            points = sum("." in cell and bool(NUMBER.fullmatch(cell)) for cell in cells)
            return separator, commas > 0 and points == 0
    if any("," in line for line in some):
        quoted = [cell for line in some if '"' in line for cell in _cells(line, ",")]
        commas = sum(bool(DECIMAL_COMMA.fullmatch(cell)) for cell in quoted)
        return ",", commas > 0 and not any("." in cell and NUMBER.fullmatch(cell) for cell in quoted)
    return (" ", False) if any(" " in line.strip() for line in some[1:]) else (",", False)


def _cells(text: str, separator: str) -> list[str]:
    """One line's cells without the spaces around them."""
    if separator == " ":
        return text.split()
    if '"' not in text:
        return [cell.strip() for cell in text.split(separator)]
    try:
        return [cell.strip() for cell in next(csv.reader([text], delimiter=separator, skipinitialspace=True))]
    except (csv.Error, StopIteration):
        return [cell.strip() for cell in text.split(separator)]


def _is_number(cell: str) -> bool:
    return bool(NUMBER.fullmatch(cell) or DECIMAL_COMMA.fullmatch(cell))


def _header(
    dataset: Dataset, rows: list[tuple[int, list[str]]], decimal_comma: bool
) -> tuple[list[str], list[str | None], list[tuple[int, list[str]]]]:
    """(names, text of a line of units for each, the rest of the rows)."""
    number, first = rows[0]
    if all(_is_number(cell) or cell.lower() in EMPTY or stamps.is_stamp(cell) for cell in first):
        names = [f"column_{place}" for place in range(1, len(first) + 1)]
        text = f"line {number} holds numbers: the table has no names, its columns are column_1 to {names[-1]}"
        dataset.findings.append(Finding("", "no_header", 0.0, 0.0, float(len(names)), "columns", text))
        return names, [None] * len(names), rows
    names = [cell or f"column_{place}" for place, cell in enumerate(first, 1)]
    while len(names) > 1 and not first[len(names) - 1] and all(len(r) < len(names) or not r[-1] for _, r in rows[1:]):
        names.pop()  # separators at the ends of all lines
    for name in names:
        if names.count(name) > 1:
            raise DataError(f"{dataset.name}:{number}: two columns are called {name[:60]}")
    unit_texts: list[str | None] = [None] * len(names)
    if len(rows) > 1:
        second = [cell if units.unit_of(cell) is not None else cell.strip("[]()") for cell in rows[1][1]]
        # a row without any number or stamp is a row of units, when it has a known one
        if len(second) == len(names) and not any(_is_number(cell) or stamps.is_stamp(cell) for cell in second if cell):
            if any(cell and units.unit_of(cell) is not None for cell in second):
                return names, list(second), rows[2:]
    return names, unit_texts, rows[1:]


def _grid(
    dataset: Dataset, rows: list[tuple[int, list[str]]], names: list[str]
) -> tuple[list[list[str]], tuple[Loss, ...]]:
    """(cells by column, rows that are left out because they are too long or too short)."""
    lost: tuple[Loss, ...] = ()
    wrong = [number for number, cells in rows if not _fits(cells, len(names))]
    if wrong:
        some = ", ".join(str(number) for number in wrong[:NAMED_LINES]) + (" ..." if len(wrong) > NAMED_LINES else "")
        text = f"{len(wrong)} rows do not have {len(names)} cells and are left out (line {some})"
        dataset.findings.append(Finding("", "ragged", 0.0, 0.0, float(len(wrong)), "rows", text))
        dataset.repairs.append(Repair("", "ragged", len(wrong), text))
        lost = (Loss("ragged", len(wrong), f"in line {wrong[0]}"),)
        rows[:] = [(number, cells) for number, cells in rows if _fits(cells, len(names))]
    if not rows:
        raise DataError(f"{dataset.name}: the table has no row below its header")
    return [[cells[index] for _, cells in rows] for index in range(len(names))], lost


def _fits(cells: list[str], count: int) -> bool:
    return len(cells) == count or (len(cells) == count + 1 and not cells[-1])


def _time(
    dataset: Dataset,
    names: list[str],
    unit_texts: list[str | None],
    cells: list[list[str]],
    mapping: Mapping[str, str],
    time_unit: str | None,
    decimal_comma: bool,
) -> tuple[set[int], Array]:
    """(indices of the time columns, stamps in s; NaN where a row has none)."""
    split = [units.split(mapping.get(name, name)) for name in names]
    candidates = [k for k, (stem, _) in enumerate(split) if stem.lower() in (*units.TIME_WORDS, *CLOCKS)]
    if not candidates:
        raise DataError(
            f"{dataset.name}: there is no time column (t_s, time_ms, timestamp_us ...) among {', '.join(names)[:200]}; "
            "--map NAME=t_s says which it is"
        )
    written = {k: found for k in candidates if (found := stamps.of(cells[k])) is not None}
    numbers = [k for k in candidates if k not in written]
    if not written or (numbers and not any(each.has_time for each in written.values())):
        index = (numbers or candidates)[0]
        dates = set(written)
        time_s = _counted(
            dataset, names[index], split[index][1], unit_texts[index], cells[index], time_unit, decimal_comma
        )
        return {index, *dates}, time_s
    whole = [k for k in written if written[k].has_date and written[k].has_time]
    chosen = whole[:1] or [k for k in written if written[k].has_date][:1]
    if not whole:
        chosen += [k for k in written if written[k].has_time][:1]
    time_ns = np.sum([written[k].time_ns for k in chosen], axis=0)
    missing = np.any([written[k].time_ns == stamps.NONE for k in chosen], axis=0)
    called = " and ".join(names[k] for k in chosen)
    with_date = any(written[k].has_date for k in chosen)
    first_ns = int(time_ns[~missing][0]) if with_date and not missing.all() else 0
    text = f"{called}: {'dates are' if with_date else 'times of the day are'} read as seconds"
    if with_date:
        text += f", 0 is {np.datetime64(first_ns, 'ns')}"
    dataset.repairs.append(Repair("", "dates", len(time_ns), text))
    return set(chosen), np.where(missing, np.nan, (time_ns - first_ns) * 1e-9)


def _counted(
    dataset: Dataset,
    name: str,
    unit: units.Unit | None,
    unit_text: str | None,
    cells: list[str],
    time_unit: str | None,
    decimal_comma: bool,
) -> Array:
    """Stamps in s of a column of numbers; NaN where a row has none."""
    said = units.unit_of(unit_text) if unit_text else None
    unit = said or unit or (units.unit_of(time_unit) if time_unit else None)
    plain = _plain_numbers(cells, decimal_comma)
    time_s = plain if plain is not None else np.array([_value(cell, decimal_comma) for cell in cells])
    if len(time_s) and np.isfinite(time_s).mean() < 0.5:
        first = next((cell for cell in cells if cell and not _is_number(cell)), "")
        raise DataError(
            f"{dataset.name}: {name}: stamps such as {first[:40]!r} are not read (numbers, 2026-11-05 09:30:00.000, "
            "05.11.2026 09:30:00,000, 11/05/2026 09:30:00 PM, 09:30:00.000)"
        )
    if unit is None:
        unit = _assumed(dataset, name, time_s)
    if unit.numerator != ("s",) or unit.denominator:
        raise DataError(f"{dataset.name}: the time column {name} is in {unit.text or 'no unit'}, not in a time")
    if unit.factor == 1.0:
        return columns.from_zero(dataset, time_s)
    text = f"{name}: times {unit.factor:g}, now in s"
    dataset.repairs.append(Repair("", "si_unit", len(time_s), text))
    whole = _whole_numbers(cells)
    if whole is not None and len(whole) and float(whole[0]) * unit.factor >= columns.EPOCH_S:
        columns.from_zero(dataset, time_s[:1] * unit.factor)  # for its note; whole numbers are subtracted below
        return (whole - whole[0]) * unit.factor
    return columns.from_zero(dataset, time_s * unit.factor)


def _assumed(dataset: Dataset, name: str, time_s: Array) -> units.Unit:
    """Unit of stamps without a given one: seconds, or a spreadsheet's days where seconds are impossible."""
    steps = np.diff(time_s[np.isfinite(time_s)])
    usual = float(np.median(np.abs(steps[steps != 0.0]))) if (steps != 0.0).any() else 0.0
    ends = columns.ends(time_s)
    if 0.0 < usual < FASTEST_S and all(SPREADSHEET_DAYS[0] < end < SPREADSHEET_DAYS[1] for end in ends):
        text = (
            f"{name}: {ends[0]:.10g} is taken for a spreadsheet's day: samples would be {usual:.3g} s apart otherwise"
        )
        dataset.findings.append(Finding("", "unit_assumed", *ends, 86400.0, "s", text))
        return units.Unit(("s",), (), 86400.0)
    text = f"{name}: nothing says the unit of the stamps; seconds are assumed"
    if usual > SLOWEST_S:
        smaller = next((unit for unit in ("ms", "us", "ns") if usual * units.ATOMS[unit][1] <= SLOWEST_S), "ns")
        better = usual * units.ATOMS[smaller][1]
        text += f", which are {usual:.6g} s apart; --time-unit {smaller} would make them {better:g} s"
    dataset.findings.append(Finding("", "unit_assumed", *ends, 1.0, "s", text))
    return units.Unit(("s",))


def _whole_numbers(cells: list[str]) -> NDArray[np.int64] | None:
    """A column of whole numbers, exactly; None for any other."""
    try:
        return np.array(list(map(int, cells)), dtype=np.int64)
    except (ValueError, OverflowError):
        return None


def _value(cell: str, decimal_comma: bool) -> float:
    """The number of a cell; "not a number" for any other text."""
    try:
        return float(cell.replace(",", ".") if decimal_comma else cell) if "_" not in cell else float("nan")
    except ValueError:
        return float("nan")


def _numbers(
    dataset: Dataset,
    channel: str,
    rows: list[tuple[int, list[str]]],
    cells: list[str],
    time_s: Array,
    decimal_comma: bool,
) -> tuple[Array, np.ndarray, float]:
    """(values, mask of those that exist, size of the last digit) of a column, with findings for unreadable cells."""
    plain = _plain_numbers(cells, decimal_comma)
    if plain is not None:
        return plain, np.ones(len(plain), dtype=bool), _last_digit(cells)
    present = np.array([cell.lower() not in EMPTY for cell in cells])
    value = np.array([_value(cell, decimal_comma) for cell in cells])
    odd = [i for i in np.flatnonzero(np.isnan(value) & present) if not re.fullmatch("[-+]?nan", cells[i].lower())]
    if odd:
        first = odd[0]
        text = f"{len(odd)} cells are no numbers, the first in line {rows[first][0]}: {cells[first][:30]!r}"
        place = [float(time_s[i]) if np.isfinite(time_s[i]) else 0.0 for i in (first, odd[-1])]
        dataset.findings.append(Finding(channel, "unreadable", place[0], place[1], float(len(odd)), "samples", text))
    return value, present, _last_digit(cells)


def _plain_numbers(cells: list[str], decimal_comma: bool) -> Array | None:
    """The values of a column in which every cell is a number, at once; None for any other."""
    if decimal_comma or "_" in "".join(cells):
        return None
    try:
        value = np.array(list(map(float, cells)))
    except ValueError:
        return None
    return None if np.isnan(value).any() else value


def _last_digit(cells: list[str]) -> float:
    """Size of the finest written digit, from a sample of the cells; 0 for numbers with exponents."""
    finest = 1.0
    some = cells[:: max(1, len(cells) // 5000)]
    written = [cell for cell in some if cell.lower() not in EMPTY]
    for cell in written[:: max(1, len(written) // 500)]:
        if "e" in cell.lower():
            return 0.0
        _, mark, digits = cell.replace(",", ".").partition(".")
        if mark:
            finest = min(finest, 10.0 ** -len(digits))
    return finest
