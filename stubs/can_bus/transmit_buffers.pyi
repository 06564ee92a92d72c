# Generated from can_bus/transmit_buffers.py and can_bus/transmit_buffers.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import Any
from typing import final

BUFFERS: int
FREE_AT: int
READY: int
ASKED: int
NEXT: int
IDENTIFIER: int
FLAGS: int
LOW: int
HIGH: int
ROW: int
BUFFER_SHIFT: int
BUFFER_MASK: int
NODE_SHIFT: int

@final
class TransmitBuffers:
    first: int
    waiting_count: int
    @property
    def rows(self) -> MutableSequence[int]: ...
    def __init__(self) -> None: ...
    def add_node(self) -> None: ...
    def waiting(self) -> list[Any]: ...
    def waiting_of(self, node: Any) -> list[Any]: ...
    def is_full(self, row: Any) -> bool: ...
    def hold(self, row: Any, bit: Any) -> None: ...
    def wire(self, row: Any) -> tuple[Any, ...]: ...
