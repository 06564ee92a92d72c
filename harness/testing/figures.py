"""What a test measured, with its limit: for messages and for JUnit properties."""

import dataclasses
from typing import Any


@dataclasses.dataclass(frozen=True)
class Figure:
    """`name`: of what; `measured` and `limit`: as text, with units."""

    name: str
    measured: str
    limit: str

    def text(self) -> str:
        """As one value: measured, and the limit behind it."""
        return f"{self.measured} (limit {self.limit})" if self.limit else self.measured


class Observed:
    """What harness.testing keeps beside a robot: the last frames, what was measured on them, perhaps a timeline."""

    def __init__(self, keeper: Any) -> None:
        self.keeper = keeper
        self.figures: list[Figure] = []
        self.timeline: Any = None  # a harness.timeline.Timeline

    def note(self, name: str, measured: str, limit: str = "") -> None:
        """Keep a figure."""
        self.figures.append(Figure(name, measured, limit))
