# Generated from firmware_sim/analog.py and firmware_sim/analog.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import Any
from typing import final

PINS: int

@final
class AnalogPins:
    places: MutableSequence[int]
    count: int
    start_times: MutableSequence[int]
    end_times: MutableSequence[int]
    start_values: MutableSequence[float]
    end_values: MutableSequence[float]
    feed: Any
    def __init__(self) -> None: ...
    def follow(self, index: Any, times: MutableSequence[int] | memoryview[int], starts: MutableSequence[float] | memoryview[float], ends: MutableSequence[float] | memoryview[float], place: Any) -> None: ...
    def _check(self, index: Any) -> None: ...
    def set_pair(self, index: int, t0: int, v0: float, t1: int, v1: float) -> None: ...
    def volts(self, index: int, time: int) -> float: ...
