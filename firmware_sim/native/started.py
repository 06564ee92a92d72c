"""Devices that a program has started, by number."""

from typing import Any


class NotStartedError(Exception):
    """The program uses a device that it has not started."""


class Started(dict):
    """Devices by number, those that the program has started."""

    def __init__(self, what: str) -> None:
        self.what = what

    def __missing__(self, number: int) -> Any:
        there = ", ".join(str(each) for each in sorted(self)) or "none"
        raise NotStartedError(f"{self.what} {number} is not started (started: {there})")
