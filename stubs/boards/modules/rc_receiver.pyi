# Generated from boards/modules/rc_receiver.py and boards/modules/rc_receiver.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import Any

TIMER_TICKS: int
CHANNELS: int
FILTER: float

class RcReceiver:
    report: Any
    levels: MutableSequence[int]
    rising: MutableSequence[int]
    seen: MutableSequence[int]
    measured: MutableSequence[int]
    pulses: MutableSequence[int]
    filtered: MutableSequence[float]
    code_levels: int
    code_channel: int
    bad_levels: int
    def __init__(self, report: Any) -> None: ...
    def capture(self, channel: int, level: int, ticks: int) -> int: ...
    def width(self, channel: int) -> float: ...
