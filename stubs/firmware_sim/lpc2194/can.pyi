# Generated from firmware_sim/lpc2194/can.py and firmware_sim/lpc2194/can.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.peripherals.can_controller import CanController
from typing import Any
from typing import final

AFMR_OFF: int
AFMR_BYPASS: int
RFS_BP: int
TX_BITS: int
MOD_KNOWN: int
NAMES: dict[int, Any]

@final
class CanFilterBlock(Block):
    controllers: list[Any]
    mode: int
    table: MutableSequence[int]
    REGISTERS: dict[int, tuple[str, ...]]
    def __init__(self, chip: Any, clocks: Any) -> None: ...
    def requests(self) -> int: ...
    def read(self, offset: int) -> int: ...
    def write(self, offset: int, value: int) -> int: ...

@final
class CanBlock(Block):
    can: CanController
    acceptance: CanFilterBlock
    number: int
    set_up: bool
    READ_ACTS: Any
    REGISTERS: Any
    def __init__(self, chip: Any, clocks: Any, number: int, acceptance: CanFilterBlock) -> None: ...
    def requests(self) -> int: ...
    def read(self, offset: int) -> int: ...
    def write(self, offset: int, value: int) -> int: ...
    def tell_ends(self) -> None: ...
