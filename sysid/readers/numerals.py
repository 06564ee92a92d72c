"""Numbers as people and programs write them, with either decimal mark, with or without thousands marks.

A cell such as 1,234 is a number with either decimal mark, and another one with each; the other cells of its table
decide. `Evidence` counts for all cells what either mark would make of them.
"""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ranger_sim.sysid.dataset import Array

EMPTY = ("", "-", "--", "na", "n/a", "#n/a", "#nv", "null", "none")
WORDS = {"true": 1.0, "false": 0.0, "on": 1.0, "off": 0.0, "yes": 1.0, "no": 0.0}  # of states
EXPONENT = r"(?:[eEdD][-+]?\d+)?"
NOT_FINITE = r"[-+]?(?:nan|inf|infinity)"
SPACES = "\u00a0\u202f\u2009 "
PLAIN = {
    ".": rf"[-+]?(?:\d+\.?\d*|\.\d+){EXPONENT}",
    ",": rf"[-+]?(?:\d+,?\d*|,\d+){EXPONENT}",
}
GROUPED = {
    ".": rf"[-+]?[1-9]\d{{0,2}}(?:([,'’{SPACES}])\d{{3}})(?:\1\d{{3}})*(?:\.\d*)?",
    ",": rf"[-+]?[1-9]\d{{0,2}}(?:([.'’{SPACES}])\d{{3}})(?:\1\d{{3}})*(?:,\d*)?",
}
NUMBER = {mark: re.compile(f"{NOT_FINITE}|{PLAIN[mark]}", re.IGNORECASE) for mark in ".,"}
THOUSANDS = {mark: re.compile(GROUPED[mark]) for mark in ".,"}
EITHER_WAY = re.compile(r"[-+]?[1-9]\d{0,2}([.,])\d{3}")  # a number with either mark, and not the same one
WHOLE = re.compile(r"[-+]?\d{1,3}")
LONG = re.compile(r"[-+]?\d{4,}(?:[.,]\d*)?")
WITH_UNIT = re.compile(r"([-+]?[\d.,]+(?:[eE][-+]?\d+)?)\s*([A-Za-zµμΩ%°\[(][^\d]{0,11})")
TRANSLATED = str.maketrans({"−": "-", "–": "-", "D": "E", "d": "e", "’": "'"})
FEWEST = 3  # cells of either kind that decide
DECIDED = 1000  # cells with one mark in a column: what has not the other needs no second look
SLIPS = 0.01  # of a column's cells may be torn ones that look like the other mark's


def is_number(cell: str) -> bool:
    """True for a number with either decimal mark."""
    cell = cell.translate(TRANSLATED) if "−" in cell else cell
    return any(NUMBER[mark].fullmatch(cell) or THOUSANDS[mark].fullmatch(cell) for mark in ".,")


def value_of(cell: str, mark: str) -> float:
    """The number of a cell with this decimal mark, or of a word of a state; "not a number" for any other text."""
    text = cell.translate(TRANSLATED) if not cell.isascii() or "d" in cell or "D" in cell else cell
    if NUMBER[mark].fullmatch(text):
        return float(text.replace(",", ".") if mark == "," else text)
    if THOUSANDS[mark].fullmatch(text):
        digits = re.sub(rf"[^\d{mark}+-]", "", text)
        return float(digits.replace(",", ".") if mark == "," else digits)
    return WORDS.get(cell.lower(), float("nan"))


class Evidence:
    """The evidence of a table's cells for the decimal mark.

    only: {column: {mark: cells that are numbers with this mark only}}; either: {column: {mark: [cells with it that are
    numbers either way, whole numbers below 1,000, longer ones]}}; example: {mark: a cell with it}; first: {(column,
    mark): line and cell of the first of `only`}.
    """

    def __init__(self) -> None:
        self.only: dict[int, dict[str, int]] = {}
        self.either: dict[int, dict[str, list[int]]] = {}
        self.example: dict[str, str] = {}
        self.first: dict[tuple[int, str], tuple[int, str]] = {}

    def add(self, column: int, cells: Sequence[str], lines: NDArray[np.int64]) -> None:
        """Count the cells of a column, (n,), which are in these lines."""
        only = self.only.setdefault(column, {".": 0, ",": 0})
        either = self.either.setdefault(column, {".": [0, 0, 0], ",": [0, 0, 0]})
        joined = "\n".join(cells)
        for mark, other in (".,", ",."):
            if only[mark] > DECIDED and other not in joined:
                return  # nothing in it could be the other's
        for place, cell in enumerate(cells):
            found = EITHER_WAY.fullmatch(cell)
            if found:
                either[found[1]][0] += 1
                self.example.setdefault(found[1], cell)
            elif WHOLE.fullmatch(cell) or LONG.fullmatch(cell):
                for each in either.values():
                    each[1 if len(cell.strip("+-")) <= 3 else 2] += 1
            if found or not cell:
                continue
            good = [mark for mark in ".," if NUMBER[mark].fullmatch(cell) or THOUSANDS[mark].fullmatch(cell)]
            if len(good) == 1:
                only[good[0]] += 1
                self.example.setdefault(good[0], cell)
                self.first.setdefault((column, good[0]), (int(lines[place]), cell))

    def mark(self) -> str:
        """The decimal mark of the table, "" where both are as good."""
        point, comma = (sum(each[mark] for each in self.only.values()) for mark in ".,")
        if point != comma:
            return "." if point > comma else ","
        votes = set()
        for counts in self.either.values():
            for mark, (grouped, short, long) in counts.items():
                other = "," if mark == "." else "."
                if grouped and (long or not short):
                    votes.add(mark)  # three decimals in every cell
                elif grouped >= FEWEST and short >= FEWEST:
                    votes.add(other)  # thousands from 1,000 on
                elif grouped:
                    return ""
        return next(iter(votes)) if len(votes) == 1 else "" if votes else "."

    def of_column(self, column: int, mark: str) -> str:
        """The decimal mark of a column; `mark` is the table's. "" where its cells contradict each other."""
        counts = self.only.get(column, {".": 0, ",": 0})
        few, many = sorted(counts.values())
        if few > SLIPS * many:
            return ""
        return mark if not many else max(counts, key=lambda each: counts[each])


def numbers(cells: Sequence[str], mark: str) -> tuple[Array, NDArray[np.bool_] | None, list[int]]:
    """(values (n,), mask of cells with something in them or None for all, places of cells that are no number)."""
    joined = "\n".join(cells)
    if mark == ".":
        plain: Sequence[str] | None = cells if "_" not in joined else None
    else:
        plain = joined.replace(",", ".").split("\n") if "." not in joined and "_" not in joined else None
    if plain is not None:
        try:
            value = np.array(list(map(float, plain)))
        except ValueError:
            pass
        else:
            return value, None, []
    value = np.array([value_of(cell, mark) if cell else np.nan for cell in cells])
    present = np.array([cell.lower() not in EMPTY for cell in cells])
    odd = [k for k in np.flatnonzero(np.isnan(value) & present).tolist() if cells[k].lower().strip("+-") != "nan"]
    return value, present, odd


def last_digit(cells: Sequence[str]) -> float:
    """Size of the finest written digit, from a sample of the cells; 0 for numbers with exponents."""
    finest = 1.0
    written = [cell for cell in cells[:: max(1, len(cells) // 500)] if cell.lower() not in EMPTY]
    for cell in written:
        if "e" in cell.lower():
            return 0.0
        _, mark, digits = cell.replace(",", ".").rpartition(".")
        if mark:
            finest = min(finest, 10.0 ** -len(digits))
    return finest
