"""Text tables: a header line with names and units, one row per instant.

Told and handled: a byte order mark, UTF-16, comment lines (#, %, //), a line of units below the header, separators
comma, semicolon, tab and spaces, decimal commas beside semicolons or tabs, stamps in s, ms, us or as ISO dates. A cell
without content is an instant at which this channel has no sample; one that is no number becomes "not a number" and a
finding. Without a header the columns are column_1, column_2 ..., and `mapping` names them.
"""

import csv
import pathlib
import re
from collections.abc import Mapping

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import units
from ranger_sim.sysid.dataset import Array, Dataset, Finding, Loss, Repair
from ranger_sim.sysid.readers import columns

COMMENTS = ("#", "%", "//")
EMPTY = ("", "-", "na", "n/a", "null", "none")
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf|infinity)", re.IGNORECASE)
DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
CLOCKS = ("datetime", "date_time", "date", "utc")  # columns that hold ISO dates, besides those called time
SNIFFED_CELLS = 50
NAMED_LINES = 3  # of the places of a finding, so many are named
LARGEST_BYTES = 2_000_000_000
MOST_LINES = 3_000_000  # each is kept as text while it is read: some hundred bytes a line


def read(path: str | pathlib.Path, mapping: Mapping[str, str] | None = None, time_unit: str | None = None) -> Dataset:
    """The channels of a text table. mapping: {column in the file: name of the channel}; time_unit: of a time column
    whose name does not say it. UserError for what is no table with a time column.
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
    time_column, time_s = _time(dataset, names, unit_texts, cells, mapping, time_unit, decimal_comma)
    time_s = columns.from_zero(dataset, time_s)
    stamped = np.isfinite(time_s)
    if not stamped.all():
        text = f"{int((~stamped).sum())} rows have no stamp and are left out"
        dataset.repairs.append(Repair("", "no_stamp", int((~stamped).sum()), text))
        dataset.findings.append(Finding("", "no_stamp", *columns.ends(time_s), float((~stamped).sum()), "rows", text))
        lost += (Loss("no_stamp", int((~stamped).sum()), f"in line {rows[int(np.argmin(stamped))][0]}"),)
    for index, name in enumerate(names):
        if index == time_column:
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
        raise UserError(f"{path}: there is no channel beside the time column {names[time_column]}")
    return dataset


def _lines(dataset: Dataset, path: pathlib.Path) -> list[tuple[int, str]]:
    """(line number, text) of every line that is not empty and no comment."""
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise UserError(f"{path}: {path.stat().st_size} bytes, a text table may have {LARGEST_BYTES}")
        content = path.read_bytes()
    except OSError as error:
        raise UserError(f"{path}: the table cannot be read ({error.strerror or error})") from None
    lines = content.count(b"\n")
    if lines > MOST_LINES:
        raise UserError(
            f"{path}: {lines} lines, a text table may have {MOST_LINES}: thin it out or split it, or use MF4 (.mf4)"
        )
    encoding = "utf-16" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        text = content.decode("latin-1")
        encoding = "latin-1"
    if "\0" in text:
        raise UserError(f"{path}: this is no text table, it has bytes of value 0")
    if encoding != "utf-8-sig":
        dataset.repairs.append(Repair("", "encoding", 0, f"the text is read as {encoding}, it is not UTF-8"))
    found = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip(" \t\r,;")]
    kept = [(number, line) for number, line in found if not line.lstrip().startswith(COMMENTS)]
    if not kept and found:  # a header behind a comment mark, as numpy writes it, and nothing else
        raise UserError(f"{path}: the table has comment lines only")
    if not kept:
        raise UserError(f"{path}: the table is empty")
    behind_mark = _header_in_comment(found, kept)
    return ([behind_mark] if behind_mark else []) + kept


def _header_in_comment(found: list[tuple[int, str]], kept: list[tuple[int, str]]) -> tuple[int, str] | None:
    """The comment line just above numbers that names as many columns, as numpy.savetxt writes headers."""
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
        return ",", False
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
    """(names, what a line of units says of each, the rest of the rows)."""
    number, first = rows[0]
    if all(_is_number(cell) or cell.lower() in EMPTY or _date_s(cell) is not None for cell in first):
        names = [f"column_{place}" for place in range(1, len(first) + 1)]
        text = f"line {number} holds numbers: the table has no names, its columns are column_1 to {names[-1]}"
        dataset.findings.append(Finding("", "no_header", 0.0, 0.0, float(len(names)), "columns", text))
        return names, [None] * len(names), rows
    names = [cell or f"column_{place}" for place, cell in enumerate(first, 1)]
    while len(names) > 1 and not first[len(names) - 1] and all(len(r) < len(names) or not r[-1] for _, r in rows[1:]):
        names.pop()  # separators at the ends of all lines
    for name in names:
        if names.count(name) > 1:
            raise UserError(f"{dataset.name}:{number}: two columns are called {name[:60]}")
    unit_texts: list[str | None] = [None] * len(names)
    if len(rows) > 1:
        second = [cell.strip("[]()") for cell in rows[1][1]]
        known = [units.unit_of(cell) for cell in second]
        if len(second) == len(names) and any(second) and all(u is not None for u in known):
            if not any(map(_is_number, second)):
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
        raise UserError(f"{dataset.name}: the table has no row below its header")
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
) -> tuple[int, Array]:
    """(index of the time column, stamps in s; not a number where there is none)."""
    for index, name in enumerate(names):
        stem, unit = units.split(mapping.get(name, name))
        if stem.lower() not in (*units.TIME_WORDS, *CLOCKS):
            continue
        some = cells[index][:SNIFFED_CELLS]
        if sum(_date_s(cell) is not None for cell in some) > len(some) // 2:
            dates = [_date_s(cell) for cell in cells[index]]
            stamps = np.array([np.nan if date is None else date for date in dates])
            dataset.repairs.append(Repair("", "dates", len(stamps), f"{name}: dates are read as seconds"))
            return index, stamps
        said = units.unit_of(unit_texts[index] or "") if unit_texts[index] else None
        unit = said or unit or (units.unit_of(time_unit) if time_unit else None)
        plain = _plain_numbers(cells[index], decimal_comma)
        stamps = plain if plain is not None else np.array([_value(cell, decimal_comma) for cell in cells[index]])
        if unit is None:
            text = f"{name}: nothing says the unit of the stamps; seconds are assumed"
            dataset.findings.append(Finding("", "unit_assumed", *columns.ends(stamps), 1.0, "s", text))
            unit = units.Unit(("s",))
        if unit.numerator != ("s",) or unit.denominator:
            raise UserError(f"{dataset.name}: the time column {name} is in {unit.text or 'no unit'}, not in a time")
        if unit.factor != 1.0:
            text = f"{name}: times {unit.factor:g}, now in s"
            dataset.repairs.append(Repair("", "si_unit", len(stamps), text))
        return index, stamps * unit.factor
    raise UserError(
        f"{dataset.name}: there is no time column (t_s, time_ms, timestamp_us ...) among {', '.join(names)[:200]}; "
        "--map NAME=t_s says which it is"
    )


def _date_s(cell: str) -> float | None:
    """An ISO date as seconds since 1970, None for everything else."""
    if not re.match(r"\d{4}-\d\d-\d\d", cell):
        return None
    try:
        return float((np.datetime64(cell.rstrip("Z"), "ns") - np.datetime64(0, "ns")) / np.timedelta64(1, "s"))
    except ValueError:
        return None


def _value(cell: str, decimal_comma: bool) -> float:
    """The number of a cell; "not a number" for what is none."""
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
    """(values, where there is one, size of the last digit) of a column; what is unreadable is told."""
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
    """Size of the finest digit that is written, by a sample of the cells; 0 beside powers of ten."""
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
