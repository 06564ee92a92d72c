"""Text tables: names and units above, one row per sample below; any separator, decimal mark, encoding and stamps.

`layout` finds how the table is written, by its first lines; `numerals` decides the decimal mark by all of its rows;
then the rows are read a chunk at a time, so that a table of millions of rows needs the memory of its numbers only.
Where a later row has another form, it is named with its line. Every line is accounted for (Dataset.lines). An empty
cell is a time without a sample of this channel; a cell that is not a number becomes "not a number" and a finding.
"""

import dataclasses
import pathlib
import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid import units
from ranger_sim.sysid.dataset import Array, Dataset, Finding, Loss, Repair
from ranger_sim.sysid.readers import columns, numerals, stamps, text_file, time_column
from ranger_sim.sysid.readers import layout as layouts

REMARKS = ("comment", "remark", "note", "kommentar", "bemerkung")  # columns that are usually empty
ROWS_OF_ONE_FORM = 20  # rows above the last one, by whose decimals a number that is cut off is seen
NAMED_LINES = 3  # number of a finding's places that are named
MOST_CELLS = 400_000_000  # 8 bytes each
NOT_MEASURED = 9.9e37  # what instruments write for an overflow and for no value (SCPI 1999, 7.2.1.5)
SAME = 0.2  # of the rows with the date of the row above: another column may be finer
THREE_DECIMALS = 1e-3  # last digit of numbers whose mark may be one of thousands
EVEN = 0.01  # of the usual step: what counts evenly without a name may be the time

HEX_NAME = re.compile(r"(?i)(?:^|[^a-z])hex(?:$|[^a-z])")
HEX, HEXADECIMAL = re.compile("(?:0[xX])?[0-9A-Fa-f]{4,16}"), 0.01  # of the cells of a column

Progress = Callable[[str, float], None]


def no_progress(what: str, share: float) -> None:
    """Nothing is shown."""


def read(
    path: str | pathlib.Path,
    mapping: Mapping[str, str] | None = None,
    time_unit: str | None = None,
    rate_hz: float | None = None,
    assumed: Mapping[str, str] | None = None,
    progress: Progress = no_progress,
) -> Dataset:
    """The channels of a text table.

    mapping: {column in the file: name of the channel}; time_unit: of a time column whose name does not give it;
    rate_hz: of the rows, in place of a time column; assumed: parts of the layout that are given (layout.KEYS).
    UserError for a file that is not a table with a time column, or that can be read in two ways.
    """
    path = pathlib.Path(path)
    assumed = dict(assumed or {})
    dataset = Dataset(path.name, {})
    survey = text_file.survey(path, assumed.get("encoding", ""))
    layout = layouts.of(path, survey, assumed)
    rows = _Rows(path, survey, layout, "names" in assumed)
    marks = _marks(path, rows, progress)
    table = _parsed(rows, marks, assumed, progress)
    if "," not in marks and "decimal" not in assumed and any(column.may_have_other_mark for column in table):
        marks = _marks(path, rows, progress, every=True)  # numbers that the first lines did not have
        table = _parsed(rows, marks, assumed, progress)
    _note_layout(dataset, layout, marks, rows, assumed)
    return _channels(dataset, rows, table, dict(mapping or {}), time_unit, rate_hz, assumed)


# --- rows ---------------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class _Change:
    """Rows of another form than those above. separator: in words, where another one gives the table's cells."""

    line: int
    rows: int
    cells: int
    separator: str


class _Rows:
    """The rows of a table, a chunk at a time; afterwards, what became of every line."""

    def __init__(self, path: pathlib.Path, survey: text_file.Survey, layout: layouts.Layout, one_table: bool) -> None:
        self.path, self.survey, self.layout, self.one_table = path, survey, layout, one_table
        self.places = np.array([], dtype=np.int64)  # line numbers of the rows
        self._start()

    def _start(self) -> None:
        self.lines: dict[str, int] = {}
        self.ragged: list[int] = []
        self.cut_off = 0
        self.again: list[int] = []
        self.kept = 0
        self._odd: list[tuple[int, bool, int]] = []  # lines that are not rows, since the last row; their cells
        self._other = ""  # the first of them
        self.changes: list[_Change] = []

    def _count(self, what: str, number: int = 1) -> None:
        self.lines[what] = self.lines.get(what, 0) + number

    def __iter__(self) -> Iterator[tuple[NDArray[np.int64], list[list[str]]]]:
        """(line numbers (n,), the cells of n rows, all of the table's width)."""
        self._start()
        layout, width, separator = self.layout, len(self.layout.names), self.layout.separator
        for number, lines, is_last in _with_last(text_file.chunks(self.path, self.survey.encoding)):
            places: list[int] = []
            rows: list[list[str]] = []
            plain = '"' not in "".join(lines)
            for place, line in enumerate(lines, number):
                if line == text_file.CONTINUED:
                    self._count("continued")
                    continue
                if place < layout.first_line:
                    self._above(place, line)
                    continue
                cells = (
                    (line.split() if separator == " " else line.split(separator))
                    if plain
                    else layouts.cells_of(line, separator)
                )
                if len(cells) == width or (len(cells) > width and not any(map(str.strip, cells[width:]))):
                    if line[:1] in "#%/; \t" and layouts.is_comment(line) and not layouts.is_data(cells):
                        self._count("comments")
                        continue
                    cells = [cell.strip() for cell in cells[:width]]
                    if any(cells) and not self._ends_here(place, cells):
                        self._settle()
                        places.append(place)
                        rows.append(cells)
                    elif not any(cells):
                        self._count("empty")
                    continue
                if layouts.is_blank(line):
                    self._count("empty")
                elif layouts.is_comment(line):
                    self._count("comments")
                elif not self._ends_here(place, [cell.strip() for cell in cells]):
                    is_data = layouts.is_data([cell.strip() for cell in cells]) or _is_data_otherwise(line)
                    self._odd.append((place, is_data, len(cells)))
                    if len(self._odd) == 1 and not self._other:
                        self._other = line
            if is_last and not self.survey.ends and places and places[-1] == number + len(lines) - 1:
                self._leave_out_cut_off(places, rows)
            if rows:
                self.kept += len(rows)
                if self.kept * width > MOST_CELLS:
                    raise DataError(f"{self.path}: a text table may have {MOST_CELLS} cells: split it, or use MF4")
                yield np.array(places, dtype=np.int64), rows
        last = self._odd.pop() if self._odd and not self.survey.ends and self._odd[-1][1] else None
        if last:
            self.cut_off = last[0]
        self._note_change()
        for place, data, _ in self._odd:  # behind the last row
            if data:
                self.ragged.append(place)
            else:
                self._count("footer")
        self._count("rows", self.kept)

    def numbers(self) -> Array:
        """The number of each row (n,) from 0, with those that are left out counted: each of them was a sample."""
        left_out = np.searchsorted(np.array(self.ragged), self.places)
        return np.arange(len(self.places), dtype=np.float64) + left_out

    def _leave_out_cut_off(self, places: list[int], rows: list[list[str]]) -> None:
        """Take out a last row without a line end whose last number has fewer decimals than all above it have."""
        above = {_decimals(row[-1]) for row in rows[-ROWS_OF_ONE_FORM - 1 : -1]}
        if len(rows) > ROWS_OF_ONE_FORM and len(above) == 1 and _decimals(rows[-1][-1]) < min(above):
            self.cut_off = places.pop()
            rows.pop()

    def _above(self, place: int, line: str) -> None:
        layout = self.layout
        what = "preamble"
        if place == layout.names_line:
            what = "names"
        elif layout.names_line < place <= layout.units_line:
            what = "units"
        elif layouts.is_blank(line):
            what = "empty"
        elif layouts.is_comment(line):
            what = "comments"
        self._count(what)

    def _settle(self) -> None:
        """Lines that are not rows, between rows: left out."""
        if self._odd:
            self._note_change()
            self.ragged += [place for place, *_ in self._odd]
            self._odd.clear()

    def _note_change(self) -> None:
        """Keep where rows of another number of cells begin, when so many follow that it is not an accident."""
        rows = [(place, count) for place, data, count in self._odd if data]
        if len(rows) >= layouts.SECOND_TABLE and len(self.changes) < NAMED_LINES:
            first, count = rows[0]
            self.changes.append(_Change(first, len(rows), count, self._separator_of_other()))
        self._other = ""

    def _separator_of_other(self) -> str:
        """The separator, in words, by which the first line of another form has the table's number of cells; or ""."""
        width = len(self.layout.names)
        return next(
            (
                name
                for name, sign in layouts.SEPARATORS.items()
                if sign != self.layout.separator and len(layouts.cells_of(self._other, sign)) == width > 1
            ),
            "",
        )

    def _ends_here(self, place: int, cells: list[str]) -> bool:
        """True for a second row of names. UserError where it begins another table."""
        if not cells or (cells[0] and (cells[0][0].isdigit() or cells[0][0] in "+-.")):
            return False
        cells = [cells[0].lstrip("\ufeff"), *cells[1:]]  # of a file that was joined to another
        if cells[: len(self.layout.names)] == list(self.layout.names):
            self.again.append(place)
            self._count("names again")
            return True
        if self.again and self.again[-1] == place - 1 and layouts.is_words(cells) and self.layout.units_line:
            self._count("names again")
            return True
        named = len(cells) > 1 and layouts.is_words(cells) and any(map(layouts.is_time_name, cells))
        if named and not self.one_table:
            raise DataError(*layouts.several_tables(self.path, self.layout.names_line or 1, place))
        if named:
            self._count("another table")
        return named


def _with_last(chunks: Iterator[tuple[int, list[str]]]) -> Iterator[tuple[int, list[str], bool]]:
    """The chunks, and whether it is the last one."""
    before = None
    for chunk in chunks:
        if before is not None:
            yield *before, False
        before = chunk
    if before is not None:
        yield *before, True


def _decimals(cell: str) -> int:
    """Characters behind the decimal mark; -1 without one."""
    return len(cell) - 1 - max(cell.rfind("."), cell.rfind(",")) if "." in cell or "," in cell else -1


def _is_data_otherwise(line: str) -> bool:
    """True for a row of nothing but numbers and stamps by any separator."""
    split = (layouts.cells_of(line, sign) for sign in layouts.SEPARATORS.values() if sign in line)
    return any(len(cells) > 1 and all(map(layouts.is_value, cells)) for cells in split)


# --- columns ------------------------------------------------------------------------------------------------


class _Column:
    """The cells of a column as numbers, and as stamps where it may have the time."""

    def __init__(self, mark: str, may_be_time: bool) -> None:
        self.mark, self.may_be_time = mark, may_be_time
        self.values: list[Array] = []
        self.present: list[NDArray[np.bool_]] = []
        self.whole: list[NDArray[np.int64]] | None = [] if may_be_time else None
        self.written: list[tuple[NDArray[np.int64], NDArray[np.int64]]] | None = [] if may_be_time else None
        self.forms = stamps.Forms()
        self.odd = 0
        self.first_odd: tuple[int, int, str] | None = None  # row, line, cell
        self.last_odd = 0
        self.other_mark = False
        self.finest, self.coarsest = 1.0, 0.0  # last digit of a part of the rows
        self.padded = False  # whole numbers of one width, some of them with zeros in front
        self.form_changes = 0  # line from which on the stamps have another form
        self.unit_text = ""
        self.first = ""
        self.rows = 0

    def add(self, cells: Sequence[str], places: NDArray[np.int64]) -> None:
        """The next rows. cells (n,), line numbers (n,)."""
        if self.may_be_time:
            self._add_stamps(cells, places)
        values, present, odd = numerals.numbers(cells, self.mark)
        if odd and not self.written:
            odd = self._with_units(cells, values, odd)
        beyond = np.abs(values) >= NOT_MEASURED
        if beyond.any():
            values[beyond] = np.nan
            odd = sorted({*odd, *np.flatnonzero(beyond).tolist()})
        if odd:
            self.odd += len(odd)
            self.last_odd = self.rows + odd[-1]
            self.other_mark = self.other_mark or any("," in cells[k] and numerals.is_number(cells[k]) for k in odd)
            if self.first_odd is None:
                self.first_odd = (self.rows + odd[0], int(places[odd[0]]), cells[odd[0]])
        if not self.values:
            one_width = len(set(map(len, cells))) == 1 and len(cells[0]) > 1
            self.padded = one_width and any(cell[0] == "0" for cell in cells) and all(map(str.isdecimal, cells))
            self.first = next((cell for cell in cells if cell), "")
        digit = numerals.last_digit(cells)
        self.finest, self.coarsest = min(self.finest, digit), max(self.coarsest, digit)
        if present is not None and self.mark == "." and not self.other_mark:
            self.other_mark = any("," in cell and numerals.EITHER_WAY.fullmatch(cell) for cell in cells)
        self.values.append(values)
        self.present.append(np.ones(len(values), dtype=bool) if present is None else present)
        self.rows += len(cells)

    @property
    def may_have_other_mark(self) -> bool:
        """True when later rows may show that the decimal mark is the other one, as 1.234 below whole numbers does."""
        return self.other_mark or (self.mark == "." and self.coarsest == 1.0 and self.finest == THREE_DECIMALS)

    def _add_stamps(self, cells: Sequence[str], places: NDArray[np.int64]) -> None:
        if self.written is not None:
            both = stamps.both_ways(cells, self.forms)
            if both is None:
                self.form_changes = int(places[0]) if self.written else 0
                self.written = None
            else:
                self.written.append(both)
        if self.whole is not None:
            try:
                self.whole.append(np.array(list(map(int, cells)), dtype=np.int64))
            except (ValueError, OverflowError):
                self.whole = None

    def _with_units(self, cells: Sequence[str], values: Array, odd: list[int]) -> list[int]:
        """Numbers with their unit in the cell, one unit in the whole column; the rest of the odd cells."""
        rest: list[int] = []
        for k in odd:
            found = numerals.WITH_UNIT.fullmatch(cells[k])
            if found and (found[2] == self.unit_text or (not self.unit_text and self.odd == 0 and not rest)):
                number = numerals.value_of(found[1], self.mark)
                if np.isfinite(number) and (self.unit_text or units.unit_of(found[2]) is not None):
                    self.unit_text = found[2]
                    values[k] = number
                    continue
            rest.append(k)
        return rest

    def value(self) -> Array:
        """All of its numbers (n,)."""
        self.values = [np.concatenate(self.values)]
        return self.values[0]

    def has_cell(self) -> NDArray[np.bool_]:
        """(n,): True where there is something."""
        self.present = [np.concatenate(self.present)]
        return self.present[0]

    def whole_numbers(self) -> NDArray[np.int64] | None:
        """All of its cells (n,), when each is a whole number."""
        return np.concatenate(self.whole) if self.whole else None

    def stamps(self, month_first: bool | None) -> stamps.Stamps | None:
        """Its cells as dates or times of the day; None when most are not."""
        if not self.written:
            return None
        day, month = (np.concatenate([each[way] for each in self.written]) for way in (0, 1))
        return stamps.chosen(day, month, self.forms, month_first)


def _marks(path: pathlib.Path, rows: _Rows, progress: Progress, every: bool = False) -> list[str]:
    """The decimal mark of each column, by all rows. UserError where two are as good, or contradict each other."""
    width = len(rows.layout.names)
    if rows.layout.decimal:
        return [rows.layout.decimal] * width
    evidence = numerals.Evidence()
    done = 0
    for number, (places, cells) in enumerate(rows):
        if not number and not every:
            if not any("," in cell for row in cells for cell in row) and rows.layout.separator == ",":
                return ["."] * width
            if not any("," in cell or numerals.EITHER_WAY.fullmatch(cell) for row in cells for cell in row):
                return ["."] * width
        for column, part in enumerate(zip(*cells, strict=True)):
            evidence.add(column, part, places)
        done += len(cells)
        progress("decimal mark", min(0.45, done / max(1, rows.survey.size / (8 * width))))
    mark = evidence.mark()
    if not mark:
        cell = next(iter(evidence.example.values()))
        first, second = (f"{numerals.value_of(cell, each):.10g}" for each in ".,")
        raise DataError(
            f"{path}: cells such as {cell!r} are {first} with a decimal point and {second} with a decimal comma, and "
            "no row decides:",
            f"  ranger-sim read {shlex.quote(str(path))} --assume decimal=point",
            f"  ranger-sim read {shlex.quote(str(path))} --assume decimal=comma",
        )
    found = [evidence.of_column(column, mark) for column in range(width)]
    if not all(found):
        column = found.index("")
        point, comma = (evidence.first[column, each] for each in ".,")
        raise DataError(
            f"{path}: {rows.layout.names[column]}: some numbers have a decimal point ({point[1]!r}, first in line "
            f"{point[0]}), others a decimal comma ({comma[1]!r}, first in line {comma[0]}); --assume decimal=point or "
            "decimal=comma leaves out the others"
        )
    return found


def _parsed(rows: _Rows, marks: list[str], assumed: Mapping[str, str], progress: Progress) -> list[_Column]:
    names, unit_texts = rows.layout.names, rows.layout.units
    table = [
        _Column(mark, _may_be_time(name, unit) or assumed.get("time") == name or names == layouts._numbered(len(names)))
        for name, unit, mark in zip(names, unit_texts, marks, strict=True)
    ]
    if not any(column.may_be_time for column in table) and table:
        for column in table:
            column.may_be_time, column.whole, column.written = True, [], []
    lines: list[NDArray[np.int64]] = []
    for places, cells in rows:
        for column, part in zip(table, zip(*cells, strict=True), strict=True):
            column.add(part, places)
        lines.append(places)
        progress("rows", 0.45 + min(0.5, 0.5 * rows.kept / max(1, rows.survey.size / (8 * len(names)))))
    rows.places = np.concatenate(lines) if lines else np.array([], dtype=np.int64)
    return table


def _may_be_time(name: str, unit_text: str | None) -> bool:
    return layouts.is_time_name(name) or _may_be_timed(name, unit_text)


# --- the dataset ----------------------------------------------------------------------------------------------


def _note_layout(
    dataset: Dataset, layout: layouts.Layout, marks: list[str], rows: _Rows, assumed: Mapping[str, str]
) -> None:
    if "," in marks:
        dataset.repairs.append(Repair("", "decimal_comma", rows.kept, "decimal commas are read as points"))
    if layout.encoding != "utf-8-sig":
        text = f"the text is read as {layout.encoding}, it is not UTF-8"
        dataset.repairs.append(Repair("", "encoding", 0, text))
    if layout.names[-1] == f"column_{len(layout.names)}" and not layout.names_line:
        count = len(layout.names)
        text = f"the table has no names, its columns are column_1 to {layout.names[-1]}"
        dataset.findings.append(Finding("", "no_header", 0.0, 0.0, float(count), "columns", text))
    if rows.again:
        text = f"the row of names comes again in line {_lines_text(rows.again)}: several recordings in one file?"
        dataset.findings.append(Finding("", "names_again", 0.0, 0.0, float(len(rows.again)), "times", text))
    of_layout = dataclasses.replace(layout, decimal="," if "," in marks else ".").as_assumptions()
    dataset.layout = {"format": "text table", **of_layout, **assumed, "columns": list(layout.names)}
    dataset.lines = dict(rows.lines)


def _lines_text(numbers: Sequence[int]) -> str:
    return ", ".join(str(each) for each in numbers[:NAMED_LINES]) + (" ..." if len(numbers) > NAMED_LINES else "")


def _channels(
    dataset: Dataset,
    rows: _Rows,
    table: list[_Column],
    mapping: dict[str, str],
    time_unit: str | None,
    rate_hz: float | None,
    assumed: Mapping[str, str],
) -> Dataset:
    names = list(rows.layout.names)
    columns.check_mapping(dataset, mapping, names)
    if not rows.kept:
        raise DataError(f"{dataset.name}: the table has no row below its header")
    if not rows.layout.names_line and not any(rows.layout.above.names):
        _refuse_words(rows, table)
    lost = _left_out(dataset, rows)
    if rate_hz is not None:
        time_column.of_rate(dataset, rate_hz, [each for each in names if layouts.is_time_name(mapping.get(each, each))])
        time_columns, time_s = set[int](), rows.numbers() / rate_hz
    else:
        time_columns, time_s = _time(dataset, rows, table, mapping, time_unit, assumed)
    stamped = np.isfinite(time_s)
    if not stamped.all():
        places = [int(each) for each in rows.places[~stamped][:NAMED_LINES]]
        count = int((~stamped).sum())
        text = f"{count} rows have no stamp and are left out (line {_lines_text(places)})"
        dataset.repairs.append(Repair("", "no_stamp", count, text))
        dataset.findings.append(Finding("", "no_stamp", *columns.ends(time_s), float(count), "rows", text))
        lost += (Loss("no_stamp", count, f"in line {places[0]}"),)
    for index, (name, column) in enumerate(zip(names, table, strict=True)):
        if index in time_columns or index in rows.layout.ignored:
            continue
        unit_text = rows.layout.units[index]
        named = columns.label(dataset.name, name, unit_text or column.unit_text or unit_text, mapping)
        if other := _other_unit(name, unit_text, column):
            ends = columns.ends(time_s)
            dataset.findings.append(Finding(named.name, "unreadable", *ends, float(column.rows), "samples", other))
            continue
        value, present = column.value(), column.has_cell()
        if column.odd and column.first_odd is not None:
            _, line, cell = column.first_odd
            text = f"{column.odd} cells are not numbers, the first in line {line}: {cell[:30]!r}"
            begin, end = (
                float(time_s[k]) if np.isfinite(time_s[k]) else 0.0 for k in (column.first_odd[0], column.last_odd)
            )
            dataset.findings.append(Finding(named.name, "unreadable", begin, end, float(column.odd), "samples", text))
        kept = present & stamped
        says_hex = bool(HEX_NAME.search(name)) and "." not in column.first
        many = column.odd > HEXADECIMAL * column.rows and column.first_odd and HEX.fullmatch(column.first_odd[2])
        if says_hex or many:
            example = column.first_odd[2] if many and column.first_odd else column.first
            text = f"hexadecimal numbers such as {example!r} are not read, left out"
            dataset.findings.append(Finding(named.name, "empty", *columns.ends(time_s), 0.0, "", text))
            continue
        if not np.isfinite(value[kept]).any():
            text = "it has no number in it, left out"
            severity = "warning" if present.any() or not name.lower().startswith(REMARKS) else "note"
            dataset.findings.append(Finding(named.name, "empty", *columns.ends(time_s), 0.0, "", text, severity))
            continue
        whole = bool(kept.all())
        finest = column.finest if column.finest < 1.0 or column.first else 0.0
        columns.add(
            dataset, name, named, time_s if whole else time_s[kept], value if whole else value[kept], finest, lost
        )
        column.values = []
    if not dataset.channels:
        called = " and ".join(names[index] for index in sorted(time_columns))
        unread = next((f" ({each.channel}: {each.text})" for each in dataset.findings if each.kind == "unreadable"), "")
        raise DataError(f"{rows.path}: there is no channel except the time column {called}{unread}")
    return dataset


def _other_unit(name: str, unit_text: str | None, column: _Column) -> str:
    """What is wrong with a column whose cells have a unit of another kind than its name or its row of units; or ""."""
    said = units.unit_of(unit_text) if unit_text else units.split(name)[1]
    in_cells = units.unit_of(column.unit_text) if column.unit_text else None
    if said is None or in_cells is None or said.same_kind(in_cells):
        return ""
    return f"cells such as {column.first[:30]!r} are in {in_cells.text}, and the column is in {said.text}: left out"


def _refuse_words(rows: _Rows, table: list[_Column]) -> None:
    """UserError for lines without names in which a column holds words: such lines are another program's records."""
    padded = next((column for column in table if column.padded), None)
    if padded is not None and rows.layout.separator == "," and not rows.layout.decimal:
        raise DataError(
            f"{rows.path}: whole numbers such as {padded.first!r} between commas, and no names: these may be decimals "
            "behind a comma, and then nothing says where a number ends (--assume decimal=point: they are whole numbers)"
        )
    for name, column in zip(rows.layout.names, table, strict=True):
        if column.odd == column.rows and column.first_odd is not None and not column.written:
            _, line, cell = column.first_odd
            raise DataError(
                f"{rows.path}:{line}: the table has no names, and its {name} holds words such as {cell[:30]!r}: these "
                "are not rows of numbers (--assume names=LINE says where the names are)"
            )


def _left_out(dataset: Dataset, rows: _Rows) -> tuple[Loss, ...]:
    """Lines that should be rows and are not."""
    lost: tuple[Loss, ...] = ()
    width = len(rows.layout.names)
    for change in rows.changes:
        text = f"from line {change.line} on {change.rows} rows have another form than those above: {change.cells} cells"
        text += f", or {width} between other separators ({change.separator})" if change.separator else f", not {width}"
        dataset.findings.append(Finding("", "form_changes", 0.0, 0.0, float(change.line), "line", text))
    if rows.ragged:
        count = len(rows.ragged)
        text = f"{count} rows do not have {width} cells and are left out (line {_lines_text(rows.ragged)})"
        dataset.findings.append(Finding("", "ragged", 0.0, 0.0, float(count), "rows", text))
        dataset.repairs.append(Repair("", "ragged", count, text))
        lost = (Loss("ragged", count, f"in line {rows.ragged[0]}"),)
        dataset.lines["left out: ragged"] = count
    if rows.cut_off:
        text = f"the last line, {rows.cut_off}, is cut off and left out"
        dataset.findings.append(Finding("", "cut_off", 0.0, 0.0, 1.0, "rows", text, "note"))
        lost += (Loss("cut_off", 1, f"in line {rows.cut_off}"),)
        dataset.lines["left out: cut off"] = 1
    dataset.rows = rows.kept + len(rows.ragged) + bool(rows.cut_off)
    return lost


def _time(
    dataset: Dataset,
    rows: _Rows,
    table: list[_Column],
    mapping: Mapping[str, str],
    time_unit: str | None,
    assumed: Mapping[str, str],
) -> tuple[set[int], Array]:
    """(indices of the time columns, stamps in s; NaN where a row has none)."""
    names = list(rows.layout.names)
    called = [mapping.get(name, name) for name in names]
    if "time" in assumed:
        if assumed["time"] not in names:
            raise DataError(
                f"{dataset.name}: --assume time={assumed['time']}: unknown column (available: {', '.join(names)})"
            )
        candidates = [names.index(assumed["time"])]
    else:
        candidates = [k for k, name in enumerate(called) if layouts.is_time_name(name)]
    step_s = rows.layout.above.step_s
    in_time = [k for k in range(len(names)) if _may_be_time(called[k], rows.layout.units[k])]
    if step_s and not any(np.isfinite(table[k].value()).any() or table[k].written for k in candidates or in_time):
        text = f"no column has stamps: they are those of the rate above the table, {step_s:.6g} s apart"
        dataset.findings.append(Finding("", "time_of_rate", 0.0, 0.0, step_s, "s", text, "note"))
        dataset.layout |= {"time": "rate", "time_unit": "s"}
        return set(candidates), step_s * rows.numbers()
    month_first = {"month-first": True, "day-first": False}.get(assumed.get("dates", ""))
    candidates = candidates or _unnamed_time(dataset, rows, table, called)
    for k in candidates:
        if table[k].form_changes:
            raise DataError(
                f"{rows.path}: {names[k]}: from line {table[k].form_changes} on the stamps have another form than "
                f"{table[k].first!r} in the first row"
            )
    written = {k: found for k in candidates if (found := table[k].stamps(month_first)) is not None}
    numbers = [k for k in candidates if k not in written]
    if not written or (numbers and not any(each.has_time for each in written.values())):
        index = (_with_unit_first(numbers, called, rows.layout.units) or candidates)[0]
        unit = units.split(called[index])[1]
        return {index, *written}, _counted(dataset, names[index], unit, rows, table[index], index, time_unit)
    if (finer := _finer(numbers, called, rows.layout.units, table, list(written.values()))) is not None:
        unit = units.split(called[finer])[1]
        return {finer, *written}, _counted(dataset, names[finer], unit, rows, table[finer], finer, time_unit)
    whole = [k for k in written if written[k].has_date and written[k].has_time]
    chosen = whole[:1] or [k for k in written if written[k].has_date][:1]
    if not whole:
        chosen += [k for k in written if written[k].has_time and k not in chosen][:1]
    time_ns = np.sum([written[k].time_ns for k in chosen], axis=0)
    missing = np.any([written[k].time_ns == stamps.NONE for k in chosen], axis=0)
    both = " and ".join(names[k] for k in chosen)
    with_date = any(written[k].has_date for k in chosen)
    first_ns = int(time_ns[~missing][0]) if with_date and not missing.all() else 0
    text = f"{both}: {'dates are' if with_date else 'times of the day are'} read as seconds"
    if with_date:
        text += f", 0 is {np.datetime64(first_ns, 'ns')}"
    dataset.repairs.append(Repair("", "dates", len(time_ns), text))
    dataset.layout |= {"time": both, "time_unit": "dates" if with_date else "times of the day"}
    dataset.clock_is_given = True
    if any(written[k].either_way for k in chosen):
        text = f"{both}: day and month may be either way round; --assume dates=day-first or month-first decides"
        dataset.findings.append(Finding("", "dates_either_way", 0.0, 0.0, 0.0, "", text))
    return set(chosen) | set(written), np.where(missing, np.nan, (time_ns - first_ns) * 1e-9)


def _finer(
    numbers: list[int],
    called: Sequence[str],
    unit_texts: Sequence[str | None],
    table: list[_Column],
    written: Sequence[stamps.Stamps],
) -> int | None:
    """A column of numbers in a unit of time that rises all the time, where the dates are the same for several rows."""
    if not any(np.mean(np.diff(each.time_ns) == 0) > SAME for each in written if each.has_time):
        return None
    return next((k for k in numbers if _may_be_timed(called[k], unit_texts[k]) and _rises(table[k])), None)


def _may_be_timed(name: str, unit_text: str | None) -> bool:
    unit = units.unit_of(unit_text) if unit_text else units.split(name)[1]
    return unit is not None and unit.numerator == ("s",) and not unit.denominator


def _with_unit_first(numbers: list[int], called: Sequence[str], unit_texts: Sequence[str | None]) -> list[int]:
    """Columns of numbers, those first whose unit is known to be a time."""
    return sorted(numbers, key=lambda k: units.split(called[k])[1] is None and not unit_texts[k])


def _unnamed_time(dataset: Dataset, rows: _Rows, table: list[_Column], called: Sequence[str]) -> list[int]:
    """The only column that can be the time: in a unit of time, or dates, or counting evenly where none has a name."""
    names = rows.layout.names
    rising = [k for k, column in enumerate(table) if column.may_be_time and _rises(column)]
    dated = [k for k, column in enumerate(table) if column.may_be_time and column.stamps(None) is not None]
    timed = [k for k in rising if _may_be_time(called[k], rows.layout.units[k])]
    found = timed or dated or ([k for k in rising if _is_even(table[k])] if not rows.layout.names_line else [])
    if len(found) != 1 and not (found and found == dated):
        example = f"{names[rising[0]]}=time" if rising else "NAME=t_s"
        raise DataError(
            f"{dataset.name}: there is no time column (t_s, time_ms, timestamp_us ...) among {', '.join(names)[:200]}; "
            f"--map {example} says which it is"
            + (" (it rises all the time)" if rising else "")
            + time_column.or_with_rate(rows.path, _single(names, table))
        )
    text = f"{names[found[0]]}: taken for the time, the only column that can be; --assume time=NAME chooses another"
    dataset.findings.append(Finding("", "time_assumed", 0.0, 0.0, 0.0, "", text))
    return found


def _single(names: Sequence[str], table: list[_Column]) -> dict[str, float]:
    """By name, the number of each column that has one only, however often."""
    found = {}
    for name, column in zip(names, table, strict=True):
        value = column.value()
        value = value[np.isfinite(value)]
        if len(value) and np.ptp(value) == 0.0:
            found[name] = float(value[0])
    return found


def _rises(column: _Column) -> bool:
    value = column.value()
    return len(value) > 2 and bool(np.isfinite(value).all()) and bool((np.diff(value) > 0.0).all())


def _is_even(column: _Column) -> bool:
    """True for stamps of one rate; a count of the rows from 0 or 1 is none."""
    steps = np.diff(column.value())
    usual = float(np.median(steps))
    return bool(np.abs(steps - usual).max() <= EVEN * usual) and not (column.whole and usual == 1.0)


def _counted(
    dataset: Dataset,
    name: str,
    unit: units.Unit | None,
    rows: _Rows,
    column: _Column,
    index: int,
    time_unit: str | None,
) -> Array:
    """Stamps in s of a column of numbers; NaN where a row has none."""
    unit_text = rows.layout.units[index] or column.unit_text
    said = units.unit_of(unit_text) if unit_text else None
    unit = said or unit or (units.unit_of(time_unit) if time_unit else None)
    time_s = column.value()
    if len(time_s) and np.isfinite(time_s).mean() < 0.5:
        first = column.first_odd[2] if column.first_odd else ""
        raise DataError(
            f"{dataset.name}: {name}: stamps such as {first[:40]!r} are not read (numbers, 2026-11-05 09:30:00.000, "
            "05.11.2026 09:30:00,000, 11/05/2026 09:30:00 PM, 09:30:00.000)"
        )
    factor = f"{unit.factor:g} s" if unit is not None else "assumed"
    dataset.layout |= {"time": name, "time_unit": unit_text if said else time_unit or factor}
    time_s, _ = time_column.seconds(dataset, str(rows.path), name, time_s, column.whole_numbers(), unit)
    return time_s
