"""Logs of candump as rows of frames, many lines at once; lines in another form are read one by one."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from ranger_sim.can_bus.edge.candump import frame_of_line
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.panel.inside.frames import ROW_WORDS, rows_of_frame

# A usual line, `(0000000012.345678) can1 0A1#0011223344556677`: positions of its digits, counted from the first letter;
# positions after the interface are counted from the last.
SECONDS, FRACTION = slice(1, 11), slice(12, 18)
IDENTIFIER, DATA = slice(-20, -17), slice(-16, None)
MARKS = ((0, "("), (11, "."), (18, ")"), (19, " "), (-21, " "), (-17, "#"))
SHORTEST = 19 + 1 + 1 + 21  # with an interface of one letter
NONE = 255
NEWLINE = ord("\n")


def _hexadecimal() -> Any:
    values = np.full(256, NONE, np.uint8)
    for value, letter in enumerate(b"0123456789ABCDEF"):
        values[letter] = values[ord(chr(letter).lower())] = value
    return values


HEXADECIMAL = _hexadecimal()


def rows_of(text: bytes) -> Any:
    """Rows (inside/frames.py) of whole lines, in their order. UserError for a line that is not part of a log."""
    letters = np.frombuffer(text, np.uint8)
    ends = np.flatnonzero(letters == NEWLINE)
    if not text.endswith(b"\n"):
        ends = np.append(ends, len(text))
    starts = np.concatenate(([0], ends[:-1] + 1)).astype(np.int64)
    lengths = ends - starts
    rows = np.zeros((len(starts), ROW_WORDS), np.int64)
    usual = int(np.bincount(lengths).argmax()) if len(lengths) else 0
    other = np.ones(len(starts), bool)
    if usual >= SHORTEST:
        chosen = np.flatnonzero(lengths == usual)
        lines = np.lib.stride_tricks.sliding_window_view(letters, usual)[starts[chosen]]
        found, good = _usual(lines)
        rows[chosen[good]] = found[good]
        other[chosen[good]] = False
    empty = []
    further: list[tuple[int, list[tuple[int, int, int]]]] = []  # of CAN FD frames: place of the line, rows
    for place in np.flatnonzero(other).tolist():
        line = text[starts[place] : ends[place]].decode("ascii", "replace")
        if not line.strip():
            empty.append(place)
            continue
        try:
            _, *frame = frame_of_line(line, fd=True)
        except ValueError as error:
            raise UserError(str(error)) from None
        rows[place], *more = rows_of_frame(*frame)
        if more:
            further.append((place, more))
    if further:
        after = [place + 1 for place, more in further for _ in more]
        rows = np.insert(rows, after, [row for _, more in further for row in more], axis=0)
        empty = [int(place + np.searchsorted(after, place, "right")) for place in empty]
    return np.delete(rows, empty, axis=0) if empty else rows


def _usual(lines: Any) -> tuple[Any, Any]:
    """(rows, mask of the valid ones) of lines of equal length that end with eight bytes of data."""
    digits = HEXADECIMAL[lines]
    good = np.ones(len(lines), bool)
    for place, mark in MARKS:
        good &= lines[:, place] == ord(mark)
    for part in (SECONDS, FRACTION):
        good &= (digits[:, part] < 10).all(axis=1)
    for part in (IDENTIFIER, DATA):
        good &= (digits[:, part] != NONE).all(axis=1)
    seconds, micro, identifiers, low, high = (digits.astype(np.float64) @ _weights(lines.shape[1])).astype(np.int64).T
    good &= identifiers < 0x800
    found = np.stack((seconds * 10**9 + micro * 1000, low << 12 | 8 << 4, high << 29 | identifiers), axis=1)
    return found, good


@functools.cache
def _weights(length: int) -> Any:
    """Weight of each letter of a line: (length, 5), in seconds, microseconds, identifier and the words of the data.

    Floats, because their products are fast; exact for values below 53 bits.
    """
    weights = np.zeros((length, 5))
    weights[SECONDS, 0] = 10.0 ** np.arange(10)[::-1]
    weights[FRACTION, 1] = 10.0 ** np.arange(6)[::-1]
    weights[IDENTIFIER, 2] = 16.0 ** np.arange(3)[::-1]
    for word, first in ((3, length - 16), (4, length - 8)):
        weights[first : first + 8, word] = 16.0 ** np.array([1, 0, 3, 2, 5, 4, 7, 6])  # the lowest byte first
    return weights
