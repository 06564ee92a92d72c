# Generated from plant/plant.py and plant/plant.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import Any

class Plant:
    time_ns: int
    step_ns: int
    steps: int
    distance_m: float
    fell: bool
    words: MutableSequence[int]
    analog_start: MutableSequence[float]
    analog_end: MutableSequence[float]
    fall_cause: str
    bridges: list[Any]
    encoders: list[Any]
    sample_names: Any
    def __init__(self, step_ns: int, start_ns: int = 0, voltages: Any = 0, words: Any = 0, samples: Any = None) -> None: ...
    def step(self) -> None: ...
    def encoder_rad(self, number: Any) -> float: ...
    def analog_line(self, number: Any) -> tuple[float, float, float]: ...
    def analog_value(self, number: Any) -> float: ...
    def fill_sample(self, row: MutableSequence[float] | memoryview[float]) -> Any: ...
