# cython: boundscheck=False, wraparound=False
# (`low` is asked for 0 ... LOW - 1 only)
"""Devices that a program has started, by number."""

from typing import Any, Final

import cython

LOW: Final = 8  # a chip has fewer devices of any kind; a program may give one a higher number all the same


class NotStartedError(Exception):
    """The program uses a device that it has not started."""


@cython.final
@cython.cclass
class Started:
    """Devices of the kind `what` that the program has started; those below LOW are found without a dictionary, too."""

    what: object
    by_number: dict
    low: list

    def __init__(self, what: str) -> None:
        self.what = what
        self.by_number = {}
        self.low = [None] * LOW

    def __contains__(self, number: int) -> bool:
        return number in self.by_number

    def add(self, number: int, device: Any) -> None:
        """Device `number` is there from now on."""
        self.by_number[number] = device
        if 0 <= number < LOW:
            self.low[number] = device

    @cython.ccall
    def at(self, number: cython.longlong) -> object:
        """Device `number`."""
        if 0 <= number < LOW and self.low[number] is not None:
            return self.low[number]
        return self.any_at(number)

    def any_at(self, number: int) -> Any:
        """Device `number`, whatever its number is."""
        if number not in self.by_number:
            there = ", ".join(str(each) for each in sorted(self.by_number)) or "none"
            raise NotStartedError(f"{self.what} {number} is not started (started: {there})")
        return self.by_number[number]
