# Generated from can_bus/disturbance.py and can_bus/disturbance.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.foundation.random_stream import RandomStream
from typing import Any
from typing import final

HIGHEST_RATE: float

@final
class Disturbance:
    next_bit: int
    frames_left: int
    position: int
    planned_bits: list[Any]
    noise: RandomStream
    bit_error_rate: float
    next_noise_bit: int
    next_misread: int
    misread: list[Any]
    def __init__(self, noise: RandomStream) -> None: ...
    def hit_node(self, bit: Any, node: Any) -> None: ...
    def hit_frames(self, count: Any, position: Any) -> None: ...
    def hit_bit(self, bit: Any) -> None: ...
    def set_rate(self, rate: Any, bit: Any) -> None: ...
