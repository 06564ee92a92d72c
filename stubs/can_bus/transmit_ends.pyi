# Generated from can_bus/transmit_ends.py and can_bus/transmit_ends.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import Any
from typing import final

BY_MESSAGE: Any

@final
class TransmitEnds:
    times: MutableSequence[int]
    statuses: MutableSequence[int]
    order: int
    def __init__(self, by_message: Any = False) -> None: ...
    def write(self, buffer: int, time: int, status: int) -> bool: ...
