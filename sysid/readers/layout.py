"""The layout of a text table: separator, row of names, row of units, first row of data, decimal mark.

Every separator is tried on the first lines, and the one with which the most of them are rows of numbers is taken when
it is clearly ahead. A row of data has as many cells as most others, at least half of them numbers, stamps or empty.
The names are the row of words above the data, in which a time is named; a row of units may follow.
"""

import csv
import dataclasses
import pathlib
import re
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence

from ranger_sim.foundation.user_error import DataError
from ranger_sim.sysid import units
from ranger_sim.sysid.readers import numerals, preamble, stamps, text_file

COMMENTS = ("#", "%", "//")
REMARK = re.compile(r"\s*;\s+[A-Za-z][^;]*")  # a comment of sigrok's, and not a row that begins with an empty cell
SETTING = re.compile(r"\w+\s*=\s*[-+\d.eE]+\s*\w*")  # behind the names of a Rigol: t0 = -1.0, tInc = 1e-6
CLOCKS = (  # in addition to those of units.TIME_WORDS
    "datetime", "date_time", "date", "utc", "datum", "uhrzeit", "clock", "x_value", "second", "seconds", "sek",
    "x-axis", "tout", "local_time", "abs_time", "rel_time", "time_stamp", "zeitstempel", "datum_uhrzeit", "time_of_day",
)  # fmt: skip
SEPARATORS = {"tab": "\t", "semicolon": ";", "comma": ",", "bar": "|", "space": " "}
HEAD_LINES = 4000
AHEAD = 0.1  # of the rows: by so much more of them the better of two separators must read
SETTINGS = 30  # rows of an older Tektronix that have settings in their first columns
SECOND_TABLE = 5  # rows of numbers below other names: another table
KEYS = {  # --assume KEY=VALUE
    "encoding": "one of " + ", ".join(text_file.ENCODINGS),
    "separator": "one of " + ", ".join(SEPARATORS),
    "decimal": "point or comma",
    "names": "number of the line with the names, 0 for none",
    "dates": "day-first or month-first",
    "time": "name of the column of stamps",
    "limits": "names of channels, with commas between, whose values at a limit are true",
    "clock": "even: rounded stamps are those of an even clock",
}
OF_ANY_FORMAT = ("limits", "clock")  # of KEYS; the others say how a text table is written


@dataclasses.dataclass(frozen=True)
class Layout:
    """How a text table is read. Lines count from 1, 0: none; names: as in the file; units: text, None: none.

    above: what the lines above say; ignored: columns that are not channels.
    """

    encoding: str
    separator: str
    decimal: str
    names_line: int
    units_line: int
    first_line: int
    names: tuple[str, ...]
    units: tuple[str | None, ...]
    above: preamble.Preamble = preamble.Preamble()
    ignored: tuple[int, ...] = ()

    def as_assumptions(self) -> dict[str, str]:
        """What --assume would say."""
        separator = next(name for name, text in SEPARATORS.items() if text == self.separator)
        return {
            "encoding": self.encoding,
            "separator": separator,
            "decimal": "comma" if self.decimal == "," else "point",
        }


def assumptions(texts: Sequence[str]) -> dict[str, str]:
    """`key=value` pairs; UserError for an unknown key or value."""
    found: dict[str, str] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if key not in KEYS or not equals or not value:
            known = "; ".join(f"{name}= {meaning}" for name, meaning in KEYS.items())
            raise DataError(f"--assume {text!r}: key=value is expected ({known})")
        allowed = {
            "encoding": text_file.ENCODINGS,
            "separator": tuple(SEPARATORS),
            "decimal": ("point", "comma"),
            "dates": ("day-first", "month-first"),
            "clock": ("even",),
        }.get(key)
        if (allowed and value not in allowed) or (key == "names" and not value.isdecimal()):
            raise DataError(f"--assume {text!r}: {key} is {KEYS[key]}")
        found[key] = value
    return found


def is_time_name(name: str) -> bool:
    """True for what files call the column of stamps."""
    stem = units.split(name)[0].lower().strip("\"'#:_ ").replace(" ", "_").removesuffix("_in")
    return stem in (*units.TIME_WORDS, *CLOCKS)


def cells_of(text: str, separator: str) -> list[str]:
    """One line's cells without the spaces around them."""
    if separator == " ":
        return text.split() if '"' not in text else _quoted(text.strip(), separator)
    if '"' not in text:
        return [cell.strip() for cell in text.split(separator)]
    return _quoted(text, separator)


def _quoted(text: str, separator: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([text], delimiter=separator, skipinitialspace=True))]
    except (csv.Error, StopIteration):
        return [cell.strip() for cell in text.split(separator)]


def is_value(cell: str) -> bool:
    """True for a number, a stamp, or a cell without a value."""
    if numerals.is_number(cell) or cell.lower() in numerals.EMPTY or stamps.is_stamp(cell):
        return True
    with_unit = numerals.WITH_UNIT.fullmatch(cell)
    return with_unit is not None and units.unit_of(with_unit[2].strip("[]()")) is not None


def is_data(cells: Sequence[str]) -> bool:
    """True for a row of which at least half the cells are values, and one is there."""
    filled = [cell for cell in cells if cell]
    good = [is_value(cell) for cell in filled]
    return bool(filled) and 2 * sum(good) >= len(good)


def is_words(cells: Sequence[str]) -> bool:
    """True for a row without any number or stamp."""
    return any(cells) and not any(numerals.is_number(cell) or stamps.is_stamp(cell) for cell in cells if cell)


def is_comment(line: str) -> bool:
    """True for a line behind a comment mark."""
    return line.lstrip().startswith(COMMENTS) or REMARK.fullmatch(line) is not None


def _bare(line: str) -> str:
    """A line without its comment mark."""
    return line.lstrip().lstrip(";" if REMARK.fullmatch(line) else "#%/").strip() if is_comment(line) else line


def is_blank(line: str) -> bool:
    """True for a line without anything but separators."""
    return not line.strip(' \t\r\f,;|"')


@dataclasses.dataclass
class _Attempt:
    """The first lines by one separator. rows: (line, cells) of those that are neither empty nor comments."""

    separator: str
    rows: list[tuple[int, list[str]]]
    count: int = 0
    data: set[int] = dataclasses.field(default_factory=set)
    share: float = 0.0


def of(path: pathlib.Path, survey: text_file.Survey, assumed: Mapping[str, str]) -> Layout:
    """The layout of a table. UserError for a file that has none, or two that are equally good."""
    number, lines = next(text_file.chunks(path, survey.encoding, HEAD_LINES), (1, []))
    head = list(enumerate(lines, number))
    kept = [(place, line) for place, line in head if not is_blank(line) and not is_comment(line)]
    if not kept:
        some = any(not is_blank(line) for _, line in head)
        raise DataError(f"{path}: the table has comment lines only" if some else f"{path}: the table is empty")
    if "separator" in assumed:
        attempt = _attempt(SEPARATORS[assumed["separator"]], kept)
    else:
        attempt = _best(path, kept)
    first, names_line, names = _names(path, attempt, head, assumed)
    below = [(place, cells) for place, cells in attempt.rows if place > names_line]
    names, unit_texts, units_line, first = _units(attempt, names, names_line, below, first)
    if names_line and not any(unit_texts):
        unit_texts = _units_above(attempt, names_line) or unit_texts
    decimal = {"point": ".", "comma": ","}.get(assumed.get("decimal", ""), "")
    ignored: tuple[int, ...] = ()
    if "Increment" in names and below:  # Rigol: units, start and increment in the row below
        units_line, cells = below[0]
        unit_texts = tuple(cell if k and units.unit_of(cell) is not None else None for k, cell in enumerate(cells))
        ignored, first = tuple(k for k in range(len(names)) if names[k] in ("X", "Start", "Increment")), units_line + 1
    begin = max(first, _longest_run(attempt))
    rows = [cells_of(line, attempt.separator) for place, line in head if place < begin and not is_blank(line)]
    if not names_line and attempt.rows[0][1][:1] == ["Record Length"]:  # older Tektronix: settings next to the data
        rows, ignored = [cells for _, cells in attempt.rows[:SETTINGS]], (0, 1, 2)
        names = ("setting", "setting value", "setting unit", "TIME", *(f"CH{k}" for k in range(1, len(names) - 3)))
        rows = [cells[:2] for cells in rows]
    above = preamble.of(rows)
    if len(above.names) == attempt.count and not any(map(is_time_name, names)):
        names, unit_texts, names_line, units_line, first = above.names, (None,) * attempt.count, 0, 0, begin
    unit_texts = _with_preamble(names, unit_texts, above, ignored)
    return Layout(
        survey.encoding, attempt.separator, decimal, names_line, units_line, first, names, unit_texts, above, ignored
    )


def _units_above(attempt: _Attempt, names_line: int) -> tuple[str | None, ...] | None:
    """The row above the names, where each of its cells is a unit."""
    above = [cells for place, cells in attempt.rows if place < names_line][-1:]
    bare = [cell.strip("[]() ") for cell in above[0]] if above else []
    if len(bare) != attempt.count or not any(bare) or any(cell and units.unit_of(cell) is None for cell in bare):
        return None
    return tuple(bare)


def _with_preamble(
    names: tuple[str, ...], unit_texts: tuple[str | None, ...], above: preamble.Preamble, ignored: tuple[int, ...]
) -> tuple[str | None, ...]:
    """The unit texts, where nothing next to the names gives them, by the preamble."""
    if any(unit_texts) or not (above.units or above.time_unit):
        return unit_texts
    found = list(unit_texts)
    times = [k for k, name in enumerate(names) if is_time_name(name)]
    channels = [k for k in range(len(names)) if k not in times and k not in ignored and names[k] != "Comment"]
    if len(channels) == len(above.units):
        for k, text in zip(channels, above.units, strict=True):
            found[k] = text if units.split(names[k])[1] is None else None
    for k in times[:1]:
        found[k] = above.time_unit or None
    return tuple(found)


def _attempt(separator: str, kept: list[tuple[int, str]]) -> _Attempt:
    attempt = _Attempt(separator, [(place, cells_of(line, separator)) for place, line in kept])
    counts = Counter(len(cells) for _, cells in attempt.rows if len(cells) > 1 and is_data(cells))
    if not counts:
        counts = Counter(len(cells) for _, cells in attempt.rows)
    attempt.count = counts.most_common(1)[0][0]
    alike = [cells for _, cells in attempt.rows if len(cells) == attempt.count]
    while attempt.count > 1 and not any(cells[attempt.count - 1] for cells in alike):  # separators at every line's end
        attempt.count -= 1
        attempt.rows = [(place, _shorn(cells)) for place, cells in attempt.rows]
    attempt.data = {place for place, cells in attempt.rows if len(cells) == attempt.count and is_data(cells)}
    good = sum(
        sum(map(is_value, cells)) / len(cells) for place, cells in attempt.rows if place in attempt.data and cells
    )
    attempt.share = good / len(attempt.rows) if attempt.count > 1 else 0.0
    return attempt


def _shorn(cells: list[str]) -> list[str]:
    """Without an empty cell behind a separator at the end."""
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def _best(path: pathlib.Path, kept: list[tuple[int, str]]) -> _Attempt:
    """The separator that reads most rows; UserError for two that read them equally well."""
    text = "\n".join(line for _, line in kept)
    tried = [_attempt(each, kept) for each in SEPARATORS.values() if each in text]
    tried.sort(key=lambda each: (-each.share, each.separator == " "))
    if not tried:
        return _attempt(",", kept)
    best = tried[0]
    for other in tried[1:]:
        if best.share == 0.0 or other.share < best.share - AHEAD or other.separator == " ":
            continue
        if _header_fits(other) and not _header_fits(best):
            best, other = other, best
        elif _header_fits(best) and not _header_fits(other):
            continue
        else:
            signs = [name for name, sign in SEPARATORS.items() if sign in (best.separator, other.separator)]
            raise DataError(
                f"{path}: its cells can be separated in two ways, {best.count} or {other.count} in a row:",
                *(f"  ranger-sim read {shlex.quote(str(path))} --assume separator={name}" for name in signs),
            )
    if best.share == 0.0:  # no row of numbers: as its first line is
        best = max(tried, key=lambda each: (len(each.rows[0][1]) > 1, each.separator != " ", each.count))
    return best


def _header_fits(attempt: _Attempt) -> bool:
    """True when a row of words has as many cells as the rows of numbers."""
    return any(len(cells) == attempt.count and is_words(cells) for _, cells in attempt.rows)


def _names(
    path: pathlib.Path, attempt: _Attempt, head: list[tuple[int, str]], assumed: Mapping[str, str]
) -> tuple[int, int, tuple[str, ...]]:
    """(line of the first row, line of the names, names); lines of comments may be names too."""
    count = attempt.count
    run = _longest_run(attempt)
    if "names" in assumed:
        line = int(assumed["names"])
        if line == 0:
            return (min(attempt.data) if attempt.data else 1), 0, _numbered(count)
        text = next((text for place, text in head if place == line), None)
        if text is None:
            raise DataError(f"{path}: --assume names={line}: the names are looked for in the first {len(head)} lines")
        bare = _bare(text)
        return line + 1, line, _unique(path, line, _shorn(cells_of(bare, attempt.separator)), [])
    above = [(place, text) for place, text in head if place < run and not is_blank(text)]
    found: list[tuple[float, int, list[str]]] = []
    for place, text in above:
        bare = _bare(text)
        cells = _as_many(bare, attempt.separator, count)
        if cells is None or not is_words(cells) or (is_comment(text) and above[-1][0] != place):
            continue
        named = any(is_time_name(cell) for cell in cells)
        known = sum(units.split(cell)[1] is not None for cell in cells) / len(cells)
        full = len(set(filter(None, cells))) >= len(cells) - 1
        are_units = all(units.unit_of(cell.strip("[]() ")) is not None for cell in cells if cell)
        found.append((3.0 * named + full + known - 2.0 * are_units, place, cells))
    _refuse_second_table(path, attempt, [each for each in found if each[0] >= 3.0], run)
    if not found:
        words = [(place, cells) for place, cells in attempt.rows if place < run and is_words(cells)]
        if words and len(words[-1][1]) > 1 and words[-1][0] == max(p for p, _ in attempt.rows if p < run):
            place, cells = words[-1]
            if len(cells) == count - 1 and _counts_rows(attempt):
                return place + 1, place, _unique(path, place, ["row", *cells], [])
            raise DataError(
                f"{path}:{place}: {len(cells)} names, and the rows below have {count} cells"
                + ("; are decimal commas between commas?" if attempt.separator == "," and count > len(cells) else "")
            )
        if not attempt.data and is_words(attempt.rows[0][1]):  # nothing but names
            place, cells = attempt.rows[0]
            return place + 1, place, _unique(path, place, cells, [])
        if not attempt.data:
            return attempt.rows[0][0], 0, _numbered(count)
        return min(attempt.data), 0, _numbered(count)
    best = max(found, key=lambda each: each[0])[0]
    tied = [each for each in found if each[0] == best]
    again = best >= 3.0 and tied[0][2] != tied[-1][2]
    _, line, cells = tied[-1] if again else tied[0]
    place_above = next((k for k in range(len(attempt.rows)) if attempt.rows[k][0] == line), 0) - 1
    if place_above >= 0 and all(units.unit_of(cell.strip("[]() ")) is not None for cell in cells if cell):
        place, upper = attempt.rows[place_above]
        if len(_shorn(upper)) == count:  # names that are numbers, above a row of units
            return line, place, _unique(path, place, _shorn(upper), [])
    group = next(
        (c for p, c in reversed(attempt.rows) if p < line and len(c) in (count, count - 1) and is_words(c)), []
    )
    return line + 1, line, _unique(path, line, cells, group)


def _counts_rows(attempt: _Attempt) -> bool:
    """True when the first cells are the numbers of the rows, which R writes without a name."""
    first = [cells[0] for place, cells in attempt.rows if place in attempt.data]
    return all(cell.isdecimal() for cell in first) and [int(cell) for cell in first] == list(
        range(int(first[0]), int(first[0]) + len(first))
    )


def _as_many(text: str, separator: str, count: int) -> list[str] | None:
    """The cells of a row of words when they are `count`, by this separator or, above aligned columns, another."""
    cells = _shorn(cells_of(text, separator))
    while len(cells) > count and (not cells[-1] or SETTING.fullmatch(cells[-1])):
        cells = cells[:-1]
    if len(cells) == count and count > 1 or (count == 1 and len(cells) == 1):
        return cells
    if separator == " ":
        cells = [cell.strip() for cell in re.split(r"\s{2,}|\t", text.strip())]
        if len(cells) == count:
            return cells
    for other in ("\t", ";", ","):
        if other != separator and other in text:
            cells = _shorn(cells_of(text, other))
            if len(cells) == count > 1:
                return cells
    return None


def _longest_run(attempt: _Attempt) -> int:
    """Line of the first row of the longest stretch of rows of data."""
    best, length, begin, now = 0, 0, 0, 0
    whole = {place for place, cells in attempt.rows if place in attempt.data and all(map(is_value, cells))}
    data = whole if 2 * len(whole) > len(attempt.data) else attempt.data
    for place, _ in attempt.rows:
        if place in data:
            begin, now = (place, 1) if not now else (begin, now + 1)
            if now > length:
                best, length = begin, now
        else:
            now = 0
    return best or attempt.rows[-1][0] + 1


def _numbered(count: int) -> tuple[str, ...]:
    return tuple(f"column_{place}" for place in range(1, count + 1))


def _unique(path: pathlib.Path, line: int, cells: list[str], group: list[str]) -> tuple[str, ...]:
    """The names of a row, those of no name numbered; equal ones with the name of their group above."""
    names = [cell or f"column_{place}" for place, cell in enumerate(cells, 1)]
    if len(set(names)) < len(names) and any(group):
        filled, last = [], ""
        for cell in [*group, *[""] * (len(names) - len(group))]:
            last = cell or last
            filled.append(last)
        names = [
            f"{above}_{name}" if names.count(name) > 1 and above else name
            for above, name in zip(filled, names, strict=False)
        ]
    for name in names:
        if names.count(name) > 1:
            first, second = [place for place, each in enumerate(names, 1) if each == name][:2]
            raise DataError(
                f"{path.name}:{line}: two columns are called {name[:60]}, columns {first} and {second}: one of them "
                "needs another name in that line"
            )
    return tuple(names)


def _refuse_second_table(
    path: pathlib.Path, attempt: _Attempt, named: list[tuple[float, int, list[str]]], run: int
) -> None:
    """UserError when a row of names has rows of numbers, and another row of names follows before the table's own."""
    for (_, place, cells), (_, later, others) in zip(named[:-1], named[1:], strict=True):
        between = sum(place < row < later for row in attempt.data)
        if between >= SECOND_TABLE and cells != others:
            raise DataError(*several_tables(path, place, later))


def several_tables(path: pathlib.Path, first: int, second: int) -> tuple[str, ...]:
    """The lines of the error for a file with several tables."""
    return (
        f"{path}: there are several tables, with names in line {first} and in line {second}; one is read at a time:",
        f"  ranger-sim read {shlex.quote(str(path))} --assume names={first}",
        f"  ranger-sim read {shlex.quote(str(path))} --assume names={second}",
    )


def _units(
    attempt: _Attempt,
    names: tuple[str, ...],
    names_line: int,
    below: list[tuple[int, list[str]]],
    first: int,
) -> tuple[tuple[str, ...], tuple[str | None, ...], int, int]:
    """(names, unit texts, line of the units, first line of data): a row of words is one of units if one is known."""
    none: tuple[str | None, ...] = (None,) * len(names)
    for place, cells in below[:4]:
        if len(cells) not in (len(names), len(names) - 1) or not is_words(cells) or not names_line:
            break
        cells = [*cells, *[""] * (len(names) - len(cells))]
        bare = [cell if units.unit_of(cell) is not None else cell.strip("[]()") for cell in cells]
        if any(cell and units.unit_of(cell) is not None for cell in bare):
            rest = [row for row in below if row[0] > place]
            while rest and len(rest[0][1]) == len(names) and is_words(rest[0][1]):  # types, or an empty row
                place, rest = rest[0][0], rest[1:]
            return names, tuple(bare), place, place + 1
    return names, none, 0, first
