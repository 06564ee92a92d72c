# Generated from can_bus/load_meter.py and can_bus/load_meter.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import Any
from typing import final

WINDOWS_KEPT: int
WINDOWS_PER_SECOND: int

@final
class LoadMeter:
    bits: int
    window_busy: int
    window_end: int
    taken_until: int
    origin_bit: int
    window_bits: int
    busiest: int
    count: int
    ring: MutableSequence[int]
    def __init__(self, bitrate: Any) -> None: ...
    def start(self, bit: Any) -> None: ...
    def mean(self, bit: Any) -> float: ...
    def largest(self) -> float: ...
    def windows(self) -> list[Any]: ...
