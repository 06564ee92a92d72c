# Generated from boards/modules/quadrature_decoder.py and boards/modules/quadrature_decoder.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.boards.modules.error_module import ErrorModule
from typing import Any
from typing import final

RING_MASK: int
SLOT_CYCLES: int
LARGEST: int
PI: float
TIMER_HZ: int

def normalised_gain(gain: Any, low: Any, high: Any) -> tuple[Any, ...]: ...

@final
class QuadratureDecoder:
    count: int
    position: int
    position_gain: int
    position_shift: int
    filter_exponent: int
    write: int
    read: int
    rate_bits: int
    sign: int
    rate_gain: int
    mean: int
    idle: int
    speed: int
    filtered: int
    rate: int
    after_glitch: bool
    ring: MutableSequence[int]
    glitches: int
    dropped_times: int
    errors: ErrorModule
    glitch_code: int
    full_code: int
    rate_shift: int
    rad_per_count: float
    def __init__(self, pulses: Any, gear: Any, errors: ErrorModule, glitch_code: int, full_code: int, filter_exponent: int = 4) -> None: ...
    def edge(self, step: int, elapsed: int) -> None: ...
    def glitch(self) -> None: ...
    def update_angle(self) -> None: ...
    def update_rate(self) -> Any: ...
    def position_rad(self) -> float: ...
    def rate_rad_s(self) -> float: ...
    def set_position(self, position: int) -> None: ...
    def count_at(self, position: int) -> int: ...
