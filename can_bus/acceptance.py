# cython: boundscheck=False, wraparound=False
# (every index below is an identifier of 11 bits, or lies between the ends of the array that is searched)
"""The identifiers that a controller accepts: what its acceptance filter lets through to its program.

A node acknowledges every frame, and counts its errors, whatever its filter says. A frame that the filter refuses costs
its board nothing: no message, no interrupt.
"""

import array
from collections.abc import Iterable
from typing import Annotated, Final

import cython

from ranger_sim.can_bus.frame import HIGHEST_EXTENDED, HIGHEST_STANDARD
from ranger_sim.foundation.events import FLAG_EXTENDED
from ranger_sim.foundation.numbers import integers
from ranger_sim.foundation.user_error import BusError

BITMAP_BYTES: Final = 256  # a bit for each identifier of 11 bits
PAIR_BYTES: Final = 8  # first and last identifier of 29 bits
# Of ranges of 29-bit identifiers that do not touch: what fits into a message between processes, with the bitmap.
MOST_EXTENDED_RANGES: Final = 223

Ranges = Iterable["int | tuple[int, int]"]


@cython.final
@cython.cclass
class Acceptance:
    """A filter from the bytes that `packed` makes; bytes of any other kind are a filter too, of whatever they say."""

    standard: bytes
    ends: Annotated[cython.longlong[::1], "readonly"]
    count: cython.longlong
    data: bytes

    def __init__(self, data) -> None:
        self.data = bytes(data)
        self.standard = self.data[:BITMAP_BYTES].ljust(BITMAP_BYTES, b"\0")
        pairs = self.data[BITMAP_BYTES:]
        words = array.array("I", pairs[: len(pairs) // PAIR_BYTES * PAIR_BYTES])
        self.count = len(words)
        self.ends = integers(max(self.count, 1))
        for place, word in enumerate(words):
            self.ends[place] = word

    @cython.ccall
    @cython.exceptval(check=False)
    def accepts(self, identifier: cython.longlong, flags: cython.longlong) -> cython.bint:
        """Whether a frame with this identifier and these flags passes."""
        bits: cython.p_uchar
        low: cython.longlong = 0
        high: cython.longlong = self.count >> 1
        middle: cython.longlong
        if flags & FLAG_EXTENDED == 0:
            bits = self.standard
            return bits[identifier >> 3 & 0xFF] >> (identifier & 7) & 1
        while low < high:  # the first range that ends at the identifier or beyond
            middle = (low + high) >> 1
            if self.ends[2 * middle + 1] < identifier:
                low = middle + 1
            else:
                high = middle
        return 2 * low < self.count and self.ends[2 * low] <= identifier


def packed(where: str, standard: Ranges = (), extended: Ranges = ()) -> bytes:
    """The bytes of a filter that accepts these identifiers, of 11 and of 29 bits: single ones, or (first, last).

    `where` begins the BusError for an identifier that does not exist, a range that ends before it begins, and more than
    MOST_EXTENDED_RANGES ranges of 29 bits.
    """
    bitmap = bytearray(BITMAP_BYTES)
    for first, last in _ranges(where, standard, HIGHEST_STANDARD, 11):
        for identifier in range(first, last + 1):
            bitmap[identifier >> 3] |= 1 << (identifier & 7)
    ends = array.array("I")  # first and last of each range, ascending; ranges that touch are one
    for first, last in sorted(_ranges(where, extended, HIGHEST_EXTENDED, 29)):
        latest = len(ends) - 1
        if latest > 0 and first <= ends[latest] + 1:
            ends[latest] = max(ends[latest], last)
        else:
            ends.extend((first, last))
    if len(ends) > 2 * MOST_EXTENDED_RANGES:
        raise BusError(f"{where}: {len(ends) // 2} ranges of 29-bit identifiers, at most {MOST_EXTENDED_RANGES} fit")
    return bytes(bitmap) + ends.tobytes()


def _ranges(where: str, given: Ranges, highest: int, bits: int) -> list[tuple[int, int]]:
    found = []
    for each in given:
        first, last = each if isinstance(each, tuple) else (each, each)
        if not 0 <= first <= last <= highest:
            shown = f"{first:#x} to {last:#x}"
            raise BusError(f"{where}: {shown} is not a range of {bits}-bit identifiers, 0 to {highest:#x}")
        found.append((first, last))
    return found
