# Generated from boards/modules/absolute_encoder.py and boards/modules/absolute_encoder.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.error_module import ErrorModule
from typing import Any
from typing import final

WORD_MASK: int
COUNTS_PER_TURN: int
SLOTS_PER_MINUTE: int
SPARE_COUNTS: int
RAD_PER_COUNT: Any

@final
class AbsoluteEncoder:
    value: int
    counts: int
    angle: int
    largest_step: int
    sign: int
    zero: int
    radians: float
    rad_per_count: float
    errors: ErrorModule
    spike_code: int
    def __init__(self, zero: int, sign: int, rpm: Any, errors: ErrorModule, spike_code: int) -> None: ...
    def accept(self, word: int) -> None: ...
    def angle_rad(self) -> float: ...
