"""One true recording in the dialects of strangers' loggers, and with their accidents.

A dialect must be read as the truth, or refused with a reason that is true of it; an accident too, or with the finding
that names it. `python -m dev.dialects` runs all of them; the suite a sample.
"""

import dataclasses
import datetime
import itertools
import math
import pathlib
from collections.abc import Callable, Iterator

import numpy as np

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import repairs, sanity
from ranger_sim.sysid.reading import Measurement, read

ROWS = 400
STEP_S = 0.01
BEGIN = datetime.datetime(2026, 11, 5, 9, 30, 0)
EPOCH_S = 1_793_871_000
RIGHT, REFUSED, FALSELY, WRONG = "right", "refused truly", "refused falsely", "wrong"


def truth() -> dict[str, np.ndarray]:
    """The true recording: stamps in s, and channels in SI by their names, each (ROWS,)."""
    t = STEP_S * np.arange(ROWS)
    noise = generator(38, "dialects").normal(size=(3, ROWS))
    return {
        "t": t,
        "voltage": 6.0 * np.sin(2.1 * t) + 0.05 * noise[0],
        "current": 1.7 * np.cos(2.1 * t) + 0.4 * np.sin(9.0 * t) + 0.01 * noise[1],
        "angle": 80.0 * np.sin(0.7 * t) + 30.0 * t + 0.001 * noise[2],
    }


UNITS = {"voltage": "V", "current": "A", "angle": "rad"}


@dataclasses.dataclass(frozen=True)
class Dialect:
    """How a table is written."""

    separator: str = ","
    decimal: str = "."
    thousands: str = ""
    digits: str = ".6f"
    names: str = "suffix"  # suffix, brackets, parentheses, row, row in brackets, none, comment, grouped
    stamps: str = "s"
    preamble: tuple[str, ...] = ()
    footer: tuple[str, ...] = ()
    encoding: str = "utf-8"
    line_end: str = "\n"
    quotes: str = ""  # all, names, text
    index: str = ""  # a column of row numbers before the time, with this name
    trailing: bool = False
    padding: int = 0
    blank_every: int = 0
    comment_every: int = 0
    current_mA: bool = False
    held: bool = False
    plus: bool = False
    refused: str = ""  # what a refusal must say, where the table can honestly be read in two ways


def number(value: float, how: Dialect, form: str = "") -> str:
    text = f"{value:{form or how.digits}}"
    if how.plus and value >= 0.0:
        text = "+" + text
    if how.thousands:
        whole, mark, rest = text.partition(".")
        sign = whole[0] if whole[0] in "+-" else ""
        digits = whole.lstrip("+-")
        groups = []
        while digits:
            groups.insert(0, digits[-3:])
            digits = digits[:-3]
        text = sign + how.thousands.join(groups) + mark + rest
    return _swapped(text, how)


def _swapped(text: str, how: Dialect) -> str:
    if how.decimal == ".":
        return text
    whole, mark, rest = text.rpartition(".")
    return whole + how.decimal + rest if mark else text


def stamp(t: float, how: Dialect) -> list[str]:
    """The cells of a stamp."""
    micros = round(t * 1e6)
    when = BEGIN + datetime.timedelta(microseconds=micros)
    part = f"{when.microsecond // 1000:03d}"
    mark = how.decimal
    forms = {
        "s": lambda: [number(t, how, ".3f")],
        "s long": lambda: [number(t, how, ".6f")],
        "s exponent": lambda: [number(t, how, ".6E")],
        "ms": lambda: [number(t * 1e3, how, ".0f")],
        "us": lambda: [f"{micros}"],
        "ns": lambda: [f"{micros * 1000}"],
        "min": lambda: [number(t / 60.0, how, ".9f")],
        "epoch s": lambda: [f"{EPOCH_S + micros // 1_000_000}{mark}{micros % 1_000_000:06d}"],
        "epoch ms": lambda: [f"{EPOCH_S * 1000 + micros // 1000}"],
        "epoch us": lambda: [f"{EPOCH_S * 1_000_000 + micros}"],
        "epoch ns": lambda: [f"{EPOCH_S * 1_000_000_000 + micros * 1000}"],
        "bare epoch s": lambda: [f"{EPOCH_S + micros // 1_000_000}{mark}{micros % 1_000_000:06d}"],
        "bare epoch ms": lambda: [f"{EPOCH_S * 1000 + micros // 1000}"],
        "bare epoch us": lambda: [f"{EPOCH_S * 1_000_000 + micros}"],
        "bare epoch ns": lambda: [f"{EPOCH_S * 1_000_000_000 + micros * 1000}"],
        "iso": lambda: [f"{when:%Y-%m-%dT%H:%M:%S}.{part}"],
        "iso space": lambda: [f"{when:%Y-%m-%d %H:%M:%S}{mark}{part}"],
        "iso Z": lambda: [f"{when:%Y-%m-%dT%H:%M:%S}.{part}Z"],
        "iso offset": lambda: [f"{when:%Y-%m-%dT%H:%M:%S}.{part}+01:00"],
        "iso slashes": lambda: [f"{when:%Y/%m/%d %H:%M:%S}.{part}"],
        "iso micros": lambda: [f"{when:%Y-%m-%d %H:%M:%S.%f}"],
        "german": lambda: [f"{when:%d.%m.%Y %H:%M:%S}{mark}{part}"],
        "german short": lambda: [f"{when:%d.%m.%y %H:%M:%S}{mark}{part}"],
        "us dates": lambda: [f"{when:%m/%d/%Y %I:%M:%S}.{part} {when:%p}"],
        "us dates 24": lambda: [f"{when:%m/%d/%Y %H:%M:%S}.{part}"],
        "named month": lambda: [f"{when:%d-%b-%Y %H:%M:%S}.{part}"],
        "date and time": lambda: [f"{when:%Y-%m-%d}", f"{when:%H:%M:%S}{mark}{part}"],
        "german date and time": lambda: [f"{when:%d.%m.%Y}", f"{when:%H:%M:%S}{mark}{part}"],
        "time of day": lambda: [f"{when:%H:%M:%S}{mark}{part}"],
        "time of day colon": lambda: [f"{when:%H:%M:%S}:{part}"],
        "excel": lambda: [number(46331.395833333336 + t / 86400.0, how, ".12f")],
    }
    return forms[how.stamps]()


TIME_NAMES = {
    "s": ("t", "s"), "s long": ("Time", "s"), "s exponent": ("Time", "s"), "ms": ("time", "ms"),
    "us": ("timestamp", "us"), "ns": ("timestamp", "ns"), "min": ("time", "min"), "epoch s": ("timestamp", "s"),
    "epoch ms": ("timestamp", "ms"), "epoch us": ("timestamp", "us"), "epoch ns": ("timestamp", "ns"),
    "german": ("Zeit", ""), "german short": ("Zeit", ""), "excel": ("Time", ""), "time of day": ("Uhrzeit", ""),
}  # fmt: skip


def written(how: Dialect, data: dict[str, np.ndarray] | None = None) -> list[str]:
    """The lines of the table, without line ends."""
    data = truth() if data is None else data
    unit = dict(UNITS, current="mA" if how.current_mA else "A")
    scale = {"current": 1e3 if how.current_mA else 1.0}
    named, time_unit = TIME_NAMES.get(how.stamps, ("timestamp", ""))
    two = how.stamps.endswith("date and time")
    times = [("Date", ""), ("Time", "")] if two else [(named, time_unit)]
    columns = [*([(how.index, "")] if how.index else []), *times, *((name, unit[name]) for name in UNITS)]
    form = {
        "suffix": lambda n, u: f"{n}_{u}" if u else n,
        "brackets": lambda n, u: f"{n} [{u}]" if u else n,
        "parentheses": lambda n, u: f"{n} ({u})" if u else n,
    }.get(how.names, lambda n, u: n)
    quoted = (lambda cell: f'"{cell}"') if how.quotes in ("all", "names") else (lambda cell: cell)
    end = how.separator if how.trailing else ""
    glue = how.separator if how.separator != " " else " " * max(1, how.padding)
    head = glue.join(quoted(form(n, u)) for n, u in columns)
    lines = list(how.preamble)
    if how.names == "comment":
        lines.append("# " + glue.join(f"{n}_{u}" if u else n for n, u in columns))
    elif how.names != "none":
        lines.append(head + end)
    if how.names.startswith("row"):
        mark = ("[", "]") if "brackets" in how.names else ("", "")
        lines.append(glue.join(quoted(f"{mark[0]}{u}{mark[1]}" if u else "") for _, u in columns) + end)
    if how.names == "row, types":
        lines.append(glue.join("float" for _ in columns) + end)
    for row in range(len(data["t"])):
        cells = [str(row)] if how.index else []
        cells += stamp(data["t"][row], how)
        for name in UNITS:
            value = data[name][row] * scale.get(name, 1.0)
            cells.append("" if how.held and name == "current" and row % 4 else number(value, how))
        if how.quotes == "all":
            cells = [f'"{cell}"' for cell in cells]
        if how.padding:
            cells = [cell.rjust(how.padding) for cell in cells]
        lines.append((how.separator if how.separator != " " else " ").join(cells) + end)
        if how.blank_every and row % how.blank_every == 3:
            lines.append("")
        if how.comment_every and row % how.comment_every == 3:
            lines.append("# a note of the operator")
    return [*lines, *how.footer]


def encoded(lines: list[str], how: Dialect) -> bytes:
    return (how.line_end.join(lines) + how.line_end).encode(how.encoding)


PREAMBLES = {
    "none": (),
    "keys": ("Device: bench 3", "Operator: m.", "Sample rate: 100 Hz", ""),
    "key cells": ("Device,bench 3", "Rate,100", "Comment,"),
    "hashes": ("# recorded by a logger", "# rate 100 Hz", "#"),
    "long": tuple(f"Channel{k} Scale = 1.{k}" for k in range(40)),
    "title": ("Measurement of 5 November", ""),
}


def dialects() -> Iterator[tuple[str, Dialect]]:
    """(name, dialect) of all, in a fixed order."""
    separators = {"comma": ",", "semicolon": ";", "tab": "\t", "bar": "|"}
    for name, sign in separators.items():  # 4 x 6 forms of names
        for names in ("suffix", "brackets", "parentheses", "row", "row in brackets", "comment"):
            yield f"{name}, names {names}", Dialect(separator=sign, names=names)
    for name, sign in separators.items():  # decimal commas
        if sign != ",":
            for stamps in ("s", "ms", "german", "date and time", "time of day", "epoch s", "excel", "iso space"):
                yield f"{name}, decimal commas, {stamps}", Dialect(sign, ",", stamps=stamps, names="brackets")
    yield "comma, quoted decimal commas", Dialect(",", ",", quotes="all")
    yield "comma, quoted decimal commas, ms", Dialect(",", ",", quotes="all", stamps="ms", names="brackets")
    for stamps in (
        "s long", "s exponent", "ms", "us", "ns", "min", "epoch s", "epoch ms", "epoch us", "epoch ns", "bare epoch s",
        "bare epoch ms", "bare epoch us", "bare epoch ns", "iso", "iso space", "iso Z", "iso offset", "iso slashes",
        "iso micros", "german", "german short", "us dates", "us dates 24", "named month", "date and time",
        "german date and time",
        "time of day", "time of day colon", "excel",
    ):  # fmt: skip
        for name, sign in (("comma", ","), ("semicolon", ";"), ("tab", "\t")):
            yield (
                f"{name}, stamps {stamps}",
                Dialect(sign, stamps=stamps, names="brackets" if sign == ";" else "suffix"),
            )
    for encoding in ("utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "cp1252"):
        yield f"encoding {encoding}", Dialect(encoding=encoding, preamble=("Prüfstand für Motoren, 20 °C",))
        yield f"encoding {encoding}, semicolons", Dialect(";", ",", encoding=encoding, preamble=("Prüfstand °C",))
    for end, text in (("CRLF", "\r\n"), ("CR", "\r")):
        for sign in (",", ";", "\t"):
            yield f"line ends {end}, {sign!r}", Dialect(sign, line_end=text)
    for kind, lines in PREAMBLES.items():
        for sign in (",", ";", "\t"):
            for names in ("suffix", "row"):
                if lines:
                    yield f"preamble {kind}, {sign!r}, {names}", Dialect(sign, names=names, preamble=lines)
    for sign, quotes in itertools.product((",", ";"), ("all", "names")):
        yield f"quotes {quotes}, {sign}", Dialect(sign, quotes=quotes)
    for thousands, decimal, sign in (
        (",", ".", ";"), (",", ".", "\t"), (".", ",", ";"), (".", ",", "\t"), ("'", ".", ";"), ("'", ".", ","),
        ("\u202f", ",", ";"), ("\u00a0", ",", ";"), (" ", ",", ";"), (" ", ".", "\t"),
    ):  # fmt: skip
        yield (
            f"thousands {thousands!r} decimal {decimal} {sign!r}",
            Dialect(sign, decimal, thousands, names="brackets", current_mA=True),
        )
    for index in ("Index", "#", "Sample", "Nr", "No."):
        for sign in (",", ";"):
            yield f"index {index}, {sign}", Dialect(sign, index=index)
    for sign in (",", ";", "\t"):
        yield f"separator at the end, {sign!r}", Dialect(sign, trailing=True)
        yield f"held channel, {sign!r}", Dialect(sign, held=True)
        yield f"blank lines, {sign!r}", Dialect(sign, blank_every=50)
        yield f"comments between, {sign!r}", Dialect(sign, comment_every=50)
        yield f"footer, {sign!r}", Dialect(sign, footer=("", "End of data", "Statistics: ok"))
        yield f"types below units, {sign!r}", Dialect(sign, names="row, types")
        yield f"milliamperes, {sign!r}", Dialect(sign, names="brackets", current_mA=True)
        yield f"plus signs, {sign!r}", Dialect(sign, plus=True)
        yield f"exponents, {sign!r}", Dialect(sign, digits=".8E")
        yield f"three decimals, {sign!r}", Dialect(sign, digits=".3f")
        yield f"general, {sign!r}", Dialect(sign, digits=".9g")
    for padding in (14, 18):
        yield f"aligned by {padding}", Dialect(" ", padding=padding)
        yield f"aligned by {padding}, decimal commas", Dialect(" ", ",", padding=padding)
        yield f"aligned by {padding}, exponents", Dialect(" ", padding=padding, digits=".7E", stamps="s exponent")
        yield f"aligned by {padding}, row of units", Dialect(" ", padding=padding, names="row")
        yield f"aligned by {padding}, comment", Dialect(" ", padding=padding, names="comment")
        yield f"padded commas by {padding}", Dialect(",", padding=padding)
    for sign in (",", ";", "\t"):
        yield f"without names, {sign!r}", Dialect(sign, names="none")


# --- accidents ----------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Accident:
    """Bytes of a damaged table. says: words of the true reason, in a refusal, a finding, a loss or a proposal.

    same: the answer must still be the truth where it is not refused. changed: {channel: a true other answer}.
    """

    content: bytes
    says: tuple[str, ...]
    same: bool = True
    ending: str = ".csv"


def accidents() -> Iterator[tuple[str, Callable[[], Accident]]]:
    """(name, what makes it) of all, in a fixed order."""
    plain = Dialect()

    def table(edit: Callable[[list[str]], list[str] | None], how: Dialect = plain) -> bytes:
        lines = written(how)
        return encoded(edit(lines) or lines, how)

    def data(edit: Callable[[dict[str, np.ndarray]], None], how: Dialect = plain) -> bytes:
        changed = truth()
        edit(changed)
        return encoded(written(how, changed), how)

    def insert(place: int, *text: str) -> Callable[[list[str]], list[str]]:
        return lambda lines: [*lines[:place], *text, *lines[place:]]

    yield "empty file", lambda: Accident(b"", ("is empty",))
    yield "only blank lines", lambda: Accident(b"\n\n\r\n", ("is empty",))
    yield "only comments", lambda: Accident(b"# a\n# b\n", ("comment lines only",))
    yield "only names", lambda: Accident(encoded(written(plain)[:1], plain), ("no row below",))
    yield "one row", lambda: Accident(encoded(written(plain)[:2], plain), ("one sample", "no row"))
    for name, lines in (("torn rows", "1.0"), ("text between", "logger restarted"), ("long rows", "1,2,3,4,5,6")):
        yield name, lambda text=lines: Accident(table(insert(100, text)), ("do not have 4 cells",))
        yield (
            f"{name}, many",
            lambda text=lines: Accident(
                table(
                    lambda rows: [
                        part for k, row in enumerate(rows) for part in ((row, text) if k % 9 == 5 else (row,))
                    ]
                ),
                ("do not have 4 cells",),
            ),
        )
    yield "cut off in a number", lambda: Accident(encoded(written(plain), plain)[:-25], ("cut off", "cells"))
    yield "cut off in a row", lambda: Accident(encoded(written(plain), plain)[:-12], ("cut off", "cells"))
    yield (
        "names again",
        lambda: Accident(table(lambda rows: [*rows[:200], rows[0], *rows[200:]]), ("names comes again",)),
    )
    yield (
        "two recordings joined with names",
        lambda: Accident(
            encoded([*written(plain), *written(plain)], plain),
            ("several recordings", "names comes again"),
            same=False,
        ),
    )
    yield (
        "two recordings joined",
        lambda: Accident(encoded([*written(plain), *written(plain)[1:201]], plain), ("go back",), same=False),
    )
    yield (
        "two recordings joined, stamps go on",
        lambda: Accident(
            data(lambda d: [d[n].__setitem__(slice(None), np.concatenate([d[n][:200], d[n][:200]])) for n in UNITS]),
            ("jump",),
            same=False,
        ),
    )
    yield (
        "two tables",
        lambda: Accident(
            encoded([*written(plain)[:100], "", "time_s,temperature_C", *(f"{k},20" for k in range(50))], plain),
            ("several tables",),
        ),
    )
    yield (
        "two tables of one width",
        lambda: Accident(
            encoded([*written(plain), "t_s,a_V,b_V,c_V", *(f"{k},1,2,3" for k in range(50))], plain),
            ("several tables",),
        ),
    )
    for name, seed in (("shuffled in blocks", 20), ("shuffled", ROWS)):
        yield (
            name,
            lambda size=seed: Accident(
                encoded([written(plain)[0], *_shuffled(written(plain)[1:], size)], plain), ("out of order", "go back")
            ),
        )
    yield "reversed", lambda: Accident(table(lambda rows: [rows[0], *rows[:0:-1]]), ("out of order", "go back"))
    yield (
        "rows twice",
        lambda: Accident(table(lambda rows: [rows[0], *(row for row in rows[1:] for _ in (0, 1))]), ("twice", "again")),
    )
    yield (
        "a block of rows twice",
        lambda: Accident(table(lambda rows: [*rows[:201], *rows[151:201], *rows[201:]]), ("twice", "again", "go back")),
    )
    yield "rows missing", lambda: Accident(table(lambda rows: [*rows[:150], *rows[190:]]), ("no sample for",))
    yield (
        "stamps of whole seconds",
        lambda: Accident(data(lambda d: d.__setitem__("t", np.floor(d["t"]))), ("rounded",), same=False),
    )
    yield (
        "stamps of tenths",
        lambda: Accident(data(lambda d: d.__setitem__("t", np.floor(d["t"] * 10) / 10)), ("rounded",), same=False),
    )
    yield (
        "dates of whole seconds",
        lambda: Accident(
            data(lambda d: d.__setitem__("t", np.floor(d["t"])), Dialect(stamps="iso")), ("rounded",), same=False
        ),
    )
    yield "all stamps equal", lambda: Accident(data(lambda d: d["t"].fill(0.0)), ("all 400 samples are at",))
    yield (
        "no time column",
        lambda: Accident(table(lambda rows: [row.partition(",")[2] for row in rows]), ("no time column",)),
    )
    yield (
        "a column of time only",
        lambda: Accident(table(lambda rows: [row.partition(",")[0] for row in rows]), ("no channel", "cells")),
    )
    yield (
        "two columns of one name",
        lambda: Accident(
            table(lambda rows: ["t_s,voltage_V,voltage_V,angle_rad", *rows[1:]]), ("two columns are called",)
        ),
    )
    yield (
        "one name missing",
        lambda: Accident(table(lambda rows: ["t_s,voltage_V,angle_rad", *rows[1:]]), ("3 names", "cells")),
    )
    yield (
        "one name too many",
        lambda: Accident(
            table(lambda rows: ["t_s,voltage_V,current_A,angle_rad,power_W", *rows[1:]]), ("5 names", "cells", "5")
        ),
    )
    yield (
        "decimal commas between commas",
        lambda: Accident(
            table(lambda rows: [rows[0], *(row.replace(".", ",") for row in rows[1:])]), ("names", "cells")
        ),
    )
    yield (
        "decimal marks mixed in a column",
        lambda: Accident(
            table(lambda rows: [*rows[:200], *(row.replace(".", ",") for row in rows[200:])], Dialect(";")),
            ("decimal point",),
        ),
    )
    yield (
        "numbers either way",
        lambda: Accident(
            (
                "t_s;a_V\n" + "".join(f"{k};{1 + k % 5},{100 + k}\n" if k % 2 else f"{k};{k % 7}\n" for k in range(5))
            ).encode(),
            ("decimal comma",),
            same=False,
        ),
    )
    yield (
        "words for numbers",
        lambda: Accident(
            table(lambda rows: [*rows[:100], rows[100].replace(rows[100].split(",")[1], "ERROR"), *rows[101:]]),
            ("not numbers",),
        ),
    )
    yield (
        "stamps missing",
        lambda: Accident(
            table(lambda rows: [*rows[:100], rows[100].partition(",")[1] + rows[100].partition(",")[2], *rows[101:]]),
            ("no stamp",),
        ),
    )
    yield (
        "overflow of a spreadsheet",
        lambda: Accident(
            table(lambda rows: [*rows[:100], ",".join(["########", *rows[100].split(",")[1:]]), *rows[101:]]),
            ("no stamp", "comment", "########"),
        ),
    )
    yield (
        "stamps in words",
        lambda: Accident(
            table(
                lambda rows: [
                    rows[0],
                    *(",".join([f"step {k}", *row.split(",")[1:]]) for k, row in enumerate(rows[1:])),
                ]
            ),
            ("stamps such as", "no stamp"),
        ),
    )
    for name, head in (
        ("gzip", b"\x1f\x8b\x08\x00"), ("zip", b"PK\x03\x04"), ("bzip2", b"BZh9"), ("xz", b"\xfd7zXZ\0"),
    ):  # fmt: skip
        yield f"compressed by {name}", lambda head=head: Accident(head + bytes(range(1, 200)), ("compressed",))
    yield (
        "bytes of value 0",
        lambda: Accident(encoded(written(plain), plain).replace(b"\n", b"\n\0", 50)[:9000], ("bytes of value 0",)),
    )
    yield "zeros at the end", lambda: Accident(encoded(written(plain), plain) + bytes(4096), ("bytes of value 0",))
    yield (
        "a long line",
        lambda: Accident(
            encoded([*written(plain)[:50], "1," * 600_000, *written(plain)[50:]], plain), ("a line of more than",)
        ),
    )
    yield (
        "a quotation mark that stays open",
        lambda: Accident(table(lambda rows: [*rows[:100], '"' + rows[100], *rows[101:]]), ("do not have 4 cells",)),
    )
    yield "a picture", lambda: Accident(b"\x89PNG\r\n\x1a\n" + bytes(100), ("a picture",))
    yield (
        "a page",
        lambda: Accident(b"<html><head></head>\n<body>502</body></html>\n", ("time column", "no row", "names")),
    )
    yield (
        "clipped",
        lambda: Accident(
            data(lambda d: d.__setitem__("voltage", np.clip(d["voltage"], -4.0, 4.0))), ("cut off at",), same=False
        ),
    )
    yield (
        "clipped on one side",
        lambda: Accident(
            data(lambda d: d.__setitem__("voltage", np.minimum(d["voltage"], 4.0))), ("cut off at",), same=False
        ),
    )
    yield "angle and rate, rate late", lambda: Accident(_angle_and_rate(late=3), ("ms after",), same=False)
    yield "angle and rate, rate early", lambda: Accident(_angle_and_rate(late=-3), ("ms before",), same=False)
    yield (
        "angle and rate, sign turned",
        lambda: Accident(_angle_and_rate(factor=-1.0), ("other way round",), same=False),
    )
    yield "angle and rate, degrees", lambda: Accident(_angle_and_rate(factor=180.0 / math.pi), ("deg/s",), same=False)
    yield "angle and rate, rpm", lambda: Accident(_angle_and_rate(factor=30.0 / math.pi), ("rpm",), same=False)
    yield (
        "angle and rate, thousands",
        lambda: Accident(_angle_and_rate(factor=1000.0), ("thousands", "in ms"), same=False),
    )
    yield "stamps in ms told as s", lambda: Accident(_angle_and_rate(base=1000.0), ("in ms",), same=False)
    yield (
        "integer that runs over",
        lambda: Accident(
            data(lambda d: d.__setitem__("angle", ((d["angle"] / 0.01).round() % 4096) * 0.01)),
            ("ran over",),
            same=False,
        ),
    )
    yield "single wrong bits", lambda: Accident(
        data(lambda d: d["angle"].__setitem__(slice(50, None, 90), d["angle"][50::90] + 512.0)),
        ("single values",), same=False,
    )  # fmt: skip
    yield (
        "a channel stuck",
        lambda: Accident(
            data(lambda d: d["voltage"].__setitem__(slice(100, 260), d["voltage"][100])),
            ("stays at", "no change"),
            same=False,
        ),
    )
    yield (
        "a channel all the time zero",
        lambda: Accident(data(lambda d: d["current"].fill(0.0)), ("all the time",), same=False),
    )
    yield (
        "values that are no numbers",
        lambda: Accident(
            data(lambda d: d["current"].__setitem__(slice(0, None, 5), np.nan)), ("not numbers",), same=False
        ),
    )
    yield (
        "a clock that runs over",
        lambda: Accident(
            data(lambda d: d.__setitem__("t", (d["t"] + 65.536 - 2.0) % 65.536), Dialect(stamps="s")), ("runs over",)
        ),
    )
    yield (
        "mixed two machines",
        lambda: Accident(
            encoded(
                [written(plain)[0], *itertools.chain(*zip(written(plain)[1:], _other_machine()[1:], strict=True))],
                plain,
            ),
            ("twice", "two recordings", "white noise"),
            same=False,
        ),
    )
    yield (
        "mixed two machines between each other's stamps",
        lambda: Accident(_interleaved(), ("two recordings",), same=False),
    )
    yield "resampled by a spreadsheet", lambda: Accident(_resampled(), ("straight lines",), same=False)


def _shuffled(rows: list[str], size: int) -> list[str]:
    stream = generator(5, "shuffle")
    made = []
    for begin in range(0, len(rows), size):
        block = rows[begin : begin + size]
        made += [block[k] for k in stream.permutation(len(block))]
    return made


def _other_machine() -> list[str]:
    data = truth()
    for name in UNITS:
        data[name] = -0.5 * data[name][::-1]
    return written(Dialect(), data)


def _interleaved() -> bytes:
    one, other = truth(), truth()
    rows = []
    for k in range(ROWS):
        for data, late, factor in ((one, 0.0, 1.0), (other, 0.004, -0.5)):
            j = k if factor > 0.0 else ROWS - 1 - k
            rows.append(f"{data['t'][k] + late:.3f},{','.join(f'{factor * data[name][j]:.6f}' for name in UNITS)}")
    return ("t_s,voltage_V,current_A,angle_rad\n" + "\n".join(rows) + "\n").encode()


def _resampled() -> bytes:
    data = truth()
    coarse = slice(0, None, 8)
    for name in UNITS:
        data[name] = np.interp(data["t"], data["t"][coarse], data[name][coarse])
    return encoded(written(Dialect(), data), Dialect())


def _angle_and_rate(late: int = 0, factor: float = 1.0, base: float = 1.0) -> bytes:
    t = STEP_S * np.arange(1000)
    angle = np.sin(1.3 * t) + 0.3 * np.sin(5.0 * t + 0.4)
    rate = 1.3 * np.cos(1.3 * (t - late * STEP_S)) + 1.5 * np.cos(5.0 * (t - late * STEP_S) + 0.4)
    rows = (f"{base * a:.4f},{b:.7f},{factor * c:.7f}" for a, b, c in zip(t, angle, rate, strict=True))
    return ("t_s,joint_angle_rad,joint_rate_rad_per_s\n" + "\n".join(rows) + "\n").encode()


# --- judgement ----------------------------------------------------------------------------------------------


def alike(found: Measurement, how: Dialect | None = None, mended: bool = False) -> str:
    """What differs from the truth, empty when nothing does."""
    true = truth()
    channels = found.mended().channels if mended else found.channels
    by_stem = {name.partition("_")[0]: channel for name, channel in channels.items()}
    if how is not None and how.names == "none":
        by_stem = dict(zip(UNITS, [each for name, each in channels.items() if name != "column_1"], strict=False))
    missing = set(UNITS) - set(by_stem)
    if missing:
        return f"without {', '.join(sorted(missing))}, there are {', '.join(channels)}"
    for name, unit in UNITS.items():
        channel = by_stem[name]
        if how is not None and how.names != "none" and channel.unit != unit:
            return f"{name} in {channel.unit!r}"
        if not len(channel.value):
            return f"{name} empty"
        begin = channel.time_s[0] if not mended else channels[next(iter(channels))].time_s[0]
        time_s = channel.time_s - begin
        places = np.round(time_s / STEP_S).astype(int)
        if len(places) != len(set(places.tolist())) or places.min() < 0 or places.max() >= ROWS:
            return f"{name}: stamps from {channel.time_s[0]:g} to {channel.time_s[-1]:g}"
        if np.abs(time_s - STEP_S * places).max() > 2e-5:
            return f"{name}: stamps off by {np.abs(time_s - STEP_S * places).max():g} s"
        kept = np.isfinite(channel.value)
        off = np.abs(channel.value - true[name][places])[kept]
        if off.max() > (6e-4 if how is not None and how.digits == ".3f" else 2e-5):
            return f"{name}: off by {off.max():g}"
        least = ROWS // 4 if how is not None and how.held and name == "current" else 0.85 * ROWS
        if how is not None and len(places) < (ROWS if least > ROWS // 4 else least):
            return f"{name}: {len(places)} samples"
    return ""


def judged_dialect(how: Dialect, folder: pathlib.Path) -> tuple[str, str]:
    """(verdict, reason) of a dialect."""
    path = folder / "table.csv"
    path.write_bytes(encoded(written(how), how))
    try:
        found = read(path)
    except UserError as error:
        return (REFUSED if how.refused and how.refused in str(error) else FALSELY), str(error)
    difference = alike(found, how)
    return (WRONG, difference) if difference else (RIGHT, "")


def judged_accident(accident: Accident, folder: pathlib.Path) -> tuple[str, str]:
    """(verdict, reason) of an accident."""
    path = folder / f"table{accident.ending}"
    path.write_bytes(accident.content)
    try:
        found = read(path)
        said = " | ".join(
            [each.text for each in found.findings]
            + [each.text for each in found.proposals]
            + [each.text for each in found.dataset.repairs]
        )
        fatal = any(each.severity == sanity.FATAL for each in found.findings)
        mended = found.dataset if fatal else repairs.mend(found.dataset, found.findings)
        for each in mended.channels.values():
            said += " | " + " | ".join(loss.text for loss in each.losses)
    except UserError as error:
        text = str(error)
        return (REFUSED, text) if any(word in text for word in accident.says) else (FALSELY, text)
    if not any(word in said for word in accident.says):
        return WRONG, f"nothing names it: {said}"
    if accident.same and not fatal:
        difference = alike(found, None, mended=True)
        if difference:
            return WRONG, difference
    return RIGHT, ""
