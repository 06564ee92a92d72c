"""Where a calibration program finds the variables: the address of each, fixed by its id.

One 32-bit word a variable, little-endian, in the order of the table. What is beyond the last word is no memory.
"""

from __future__ import annotations

BASE = 0x10000  # chosen by us: 0, which programs take for "no address", belongs to nothing
WORD_BYTES = 4


def address_of(number: int) -> int:
    """The address of the variable with this id."""
    return BASE + WORD_BYTES * number
