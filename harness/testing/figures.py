"""Measurements of a test, with their limits: for messages and for JUnit properties."""

import dataclasses
from typing import Any


@dataclasses.dataclass(frozen=True)
class Figure:
    """`name`: of what; `measured` and `limit`: as text, with units."""

    name: str
    measured: str
    limit: str

    def text(self) -> str:
        """As one value: measured, and the limit after it."""
        return f"{self.measured} (limit {self.limit})" if self.limit else self.measured


class Observed:
    """Records of harness.testing for a robot: the last frames, measurements on them, perhaps a timeline."""

    def __init__(self, keeper: Any) -> None:
        self.keeper = keeper
        self.figures: list[Figure] = []
        self.timeline: Any = None  # a harness.timeline.Timeline

    def note(self, name: str, measured: str, limit: str = "") -> None:
        """Record a figure."""
        self.figures.append(Figure(name, measured, limit))
