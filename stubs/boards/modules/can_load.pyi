# Generated from boards/modules/can_load.py and boards/modules/can_load.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import final

@final
class CanLoad:
    counts: MutableSequence[int]
    peaks: MutableSequence[int]
    last_counts: MutableSequence[int]
    def __init__(self) -> None: ...
    def count(self, channel: int) -> None: ...
    def end_of_millisecond(self) -> None: ...
    def report_peak(self, channel: int) -> float: ...
