# Generated from can_bus/bit_level.py and can_bus/bit_level.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.can_bus.disturbance import Disturbance
from ranger_sim.can_bus.transmit_buffers import TransmitBuffers
from typing import Any
from typing import final

@final
class BitLevel:
    machines: list[Any]
    levels: list[Any]
    aborting: list[Any]
    buffers: TransmitBuffers
    disturbance: Disturbance
    first_bit: int
    bit: int
    quiet: int
    heard_bit: int
    sent_bit: int
    bitrate: int
    tampering: Any
    open: bool
    at_rest: bool
    away: bool
    identifier: int
    flags: int
    sender: int
    in_error: bool
    counted: bool
    error_field: int
    error_begun: int
    error_position: int
    def __init__(self, buffers: TransmitBuffers, disturbance: Disturbance, bitrate: int) -> None: ...
    def _forget_frame(self) -> None: ...
    def add_node(self, node: Any) -> None: ...
    def leave(self, node: Any) -> None: ...
    def join(self, node: Any, since: Any) -> int: ...
    def is_sending(self, row: Any) -> bool: ...
    def forget(self, row: Any) -> None: ...
