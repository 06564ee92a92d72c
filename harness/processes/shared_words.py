"""Shared words and bells between processes.

Interpreted modules use the functions below; compiled modules use those of the same names in shared_words.pxd.

Between processes a plain store and load need an order. The compiled ones are sequentially consistent; here every
`post` and `pause` is a system call, which is never left out in this mode (`Bell`) and orders the accesses around it.
"""

import os
from typing import Any

MASK = 0xFFFFFFFFFFFFFFFF
SIGN = 1 << 63
PRIME = 1099511628211  # of the 64-bit FNV hash


def load(words: Any, place: int) -> int:
    """The word at `place`."""
    return words[place]


def store(words: Any, place: int, value: int) -> None:
    """Write the word at `place`."""
    words[place] = value


def mix(so_far: int, word: int) -> int:
    """One step of the check over a message: (so_far ^ word) * PRIME in 64 bits, as a signed number."""
    value = ((so_far ^ word) & MASK) * PRIME & MASK
    return value - (1 << 64) if value & SIGN else value


def post(descriptor: int) -> None:
    """Add one to the eventfd."""
    os.eventfd_write(descriptor, 1)


def pause(descriptor: int) -> None:
    """Sleep until the eventfd is not zero, and set it to zero."""
    os.eventfd_read(descriptor)
