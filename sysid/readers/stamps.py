"""Stamps as people and programs write them: dates, times of the day, or both, as whole nanoseconds.

A date is year-month-day, or day and month with the year behind, between dots, strokes or slashes; a time of the day has
hours and minutes, seconds with either decimal mark, AM or PM, and a zone behind it. Where day and month may be either
way round, the way is taken that all rows allow and that takes less time from first to last.
"""

import calendar
import dataclasses
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

DAY_NS, SECOND_NS = 86_400_000_000_000, 1_000_000_000
FEW_DAYS = 3  # a recording takes no more; of two ways to read its dates, one that makes it shorter is right
DATE = (
    r"(?P<year>\d{4})[-/.](?P<month>\d\d?)[-/.](?P<day>\d\d?)"
    r"|(?P<first>\d\d?)[-/.](?P<second>\d\d?)[-/.](?P<late>\d{4}|\d\d)"
    r"|(?P<of_month>\d\d?)[- .]+(?P<named>[A-Za-z]{3})[a-z]*[- .,]+(?P<of_year>\d{4}|\d\d)"
)
TIME = (
    r"(?:(?P<days>\d{1,4}) days?,? )?"
    r"(?P<h>\d\d?):(?P<m>\d\d)(?::(?P<s>\d\d)(?:[.,:](?P<part>\d{1,9}))?)?\s*(?P<half>[AaPp]\.?[Mm]\.?)?"
    r"\s*(?P<zone>Z|UTC|GMT|[+-]\d\d:?\d\d)?"
)
STAMP = re.compile(rf"(?:(?P<date>{DATE})(?:[T ]\s*(?=\d))?)?(?P<time>{TIME})?")
COMPACT = re.compile(  # 20261105T093000.123, and without anything between
    r"((?:19|20)\d\d)(0[1-9]|1[0-2])(0[1-9]|[12]\d|3[01])[T _-]?([01]\d|2[0-3])([0-5]\d)([0-5]\d)[.,]?(\d{1,9})?Z?"
)
MONTHS = {
    name: k % 12 + 1
    for k, name in enumerate(
        "jan feb mar apr may jun jul aug sep oct nov dec jan feb mrz apr mai jun jul aug sep okt nov dez".split()
    )
}  # English and German
CENTURY = 2000
MINUTES = re.compile(r"\d\d?:\d\d[.,]\d{1,9}")  # minutes and seconds, as spreadsheets show short times
NONE = np.iinfo(np.int64).min  # in an array: no stamp


@dataclasses.dataclass(frozen=True)
class Stamps:
    """time_ns: shape (n,), NONE where a cell is not a stamp. has_date, has_time: what the cells hold.

    either_way: day and month can be exchanged in every cell, and the stamps are then not the same distances.
    """

    time_ns: NDArray[np.int64]
    has_date: bool
    has_time: bool
    either_way: bool = False


@dataclasses.dataclass
class Forms:
    """What the cells of a column hold, as far as they are read: a date, a time, strokes between day and month."""

    has_date: bool = False
    has_time: bool = False
    strokes: bool = False
    seen: bool = False


def _match(cell: str) -> re.Match[str] | None:
    if (packed := COMPACT.fullmatch(cell)) is not None:
        year, month, day, hour, minute, second, part = packed.groups()
        cell = f"{year}-{month}-{day} {hour}:{minute}:{second}" + (f".{part}" if part else "")
    return STAMP.fullmatch(f"00:{cell}" if MINUTES.fullmatch(cell) else cell)


def is_stamp(cell: str) -> bool:
    """True for a date, a time of the day, or both."""
    found = _match(cell)
    return found is not None and bool(found["date"] or found["time"])


def both_ways(cells: Sequence[str], forms: Forms) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """The stamps of a part of a column (n,), day first and month first; None when most of its cells are not stamps."""
    found = [_match(cell) if cell else None for cell in cells]
    good = [each for each in found if each is not None and each[0]]
    if 2 * len(good) <= len(cells):
        return None
    if not forms.seen:
        date = good[0]["date"] or ""
        forms.has_date, forms.has_time = bool(date), bool(good[0]["time"])
        forms.strokes, forms.seen = "/" in date, True
    day = _all_of(found, False)
    return day, _all_of(found, True) if any(each["first"] for each in good) else day


def chosen(
    day_first: NDArray[np.int64], month_first: NDArray[np.int64], forms: Forms, wanted: bool | None
) -> Stamps | None:
    """The stamps (n,) of a whole column; None when none is in the calendar. wanted: True for the month first."""
    ways = (day_first, month_first)
    counts = [int((way != NONE).sum()) for way in ways]
    if not max(counts):
        return None
    spans = [int(np.ptp(way[way != NONE])) if count else 0 for way, count in zip(ways, counts, strict=True)]
    # strokes have the month first; dots, and everything else, the day
    best = min((0, 1), key=lambda way: (-counts[way], spans[way], bool(way) != forms.strokes))
    if wanted is not None:
        best = int(wanted)
    either = wanted is None and counts[0] == counts[1] and spans[0] != spans[1] and min(spans) > FEW_DAYS * DAY_NS
    return Stamps(ways[best], forms.has_date, forms.has_time, either)


def _all_of(found: list[re.Match[str] | None], month_first: bool) -> NDArray[np.int64]:
    days: dict[str, int | None] = {}
    stamps = np.full(len(found), NONE, dtype=np.int64)
    for number, each in enumerate(found):
        if each is None or not each[0]:
            continue
        date = each["date"] or ""
        if date not in days:
            days[date] = _day(each, month_first) if date else 0
        day, part_ns = days[date], _time_of_day_ns(each) if each["time"] else 0
        if day is not None and part_ns is not None:
            stamps[number] = day * DAY_NS + part_ns
    return stamps


def _day(found: re.Match[str], month_first: bool) -> int | None:
    """Days since 1970; None for a date that is not in the calendar."""
    if found["year"]:
        year, month, day = (int(found[name]) for name in ("year", "month", "day"))
    elif found["named"]:
        if found["named"].lower() not in MONTHS:
            return None
        year, day = int(found["of_year"]), int(found["of_month"])
        year += CENTURY if year < 100 else 0
        month = MONTHS[found["named"].lower()]
    else:
        year, first, second = (int(found[name]) for name in ("late", "first", "second"))
        year += CENTURY if year < 100 else 0
        month, day = (first, second) if month_first else (second, first)
    if not 1 <= month <= 12 or not 1 <= day <= calendar.monthrange(max(year, 1), month)[1]:
        return None
    return calendar.timegm((year, month, day, 0, 0, 0, 0, 0, 0)) // 86_400


def _time_of_day_ns(found: re.Match[str]) -> int | None:
    """Nanoseconds since midnight, of UTC where the zone is given; None for a time that no clock shows."""
    hour, minute, second = int(found["h"]), int(found["m"]), int(found["s"] or 0)
    half = (found["half"] or "").lower()
    most = 12 if half else 24 if found["date"] else 99  # without a date it may be the time since the beginning
    if hour > most or minute > 59 or second > 60:
        return None
    if half:
        hour = hour % 12 + (12 if half[0] == "p" else 0)
    zone = found["zone"] or "Z"
    away = 0 if zone.isalpha() else (int(zone[1:3]) * 60 + int(zone[-2:])) * (-1 if zone[0] == "-" else 1)
    hour += 24 * int(found["days"] or 0)
    seconds = hour * 3600 + (minute - away) * 60 + second
    return seconds * SECOND_NS + int((found["part"] or "0").ljust(9, "0"))
