"""Calls between this program and one in C, both ways.

Interpreted, the functions below are used, and an address is what the library gave. Compiled modules use those of the
same names in program.pxd: nothing but a call in C lies between.
"""

from typing import Any


def pointer(address: Any) -> Any:
    """A pointer to what is at `address`."""
    return address


def call_work(code: Any) -> int:
    """Run a function without arguments; returns its result of 32 bits."""
    return code()


def call_hook(code: Any) -> None:
    """Run a function without arguments and result."""
    code()


def call_turn(code: Any) -> int:
    """Run a function without arguments; returns its result of 64 bits."""
    return code()


def set_word(place: Any, value: int) -> None:
    """Write a word of 32 bits."""
    place[0] = value


def answer_by(function: Any) -> int:
    """Address of the function through which all programs call `function`."""
    raise NotImplementedError
