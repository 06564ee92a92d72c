# Generated from harness/processes/stage.py and harness/processes/stage.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.plant.ranger import RangerPlant
from typing import Any

class Stage:
    words: MutableSequence[int]
    step_times: MutableSequence[int]
    doubles: MutableSequence[float]
    plant: RangerPlant
    wires: list[Any]
    rows: int
    shown_end: int
    word_count: int
    voltage_count: int
    def __init__(self, words: MutableSequence[int] | memoryview[int], doubles: MutableSequence[float] | memoryview[float], plant: RangerPlant, step_times: MutableSequence[int] | memoryview[int], wires: list[Any]) -> None: ...
    def update(self) -> None: ...

class Audience:
    words: MutableSequence[int]
    step_times: MutableSequence[int]
    board_words: MutableSequence[int]
    sources: MutableSequence[int]
    registers: MutableSequence[int]
    doubles: MutableSequence[float]
    analog_start: MutableSequence[float]
    analog_end: MutableSequence[float]
    rows: int
    word_count: int
    voltage_count: int
    def __init__(self, words: MutableSequence[int] | memoryview[int], doubles: MutableSequence[float] | memoryview[float], step_times: MutableSequence[int] | memoryview[int], analog_start: MutableSequence[float] | memoryview[float], analog_end: MutableSequence[float] | memoryview[float], board_words: MutableSequence[int] | memoryview[int], wires: Any) -> None: ...
    def row_start(self, row: int) -> int: ...
    def show(self, row: int) -> None: ...
