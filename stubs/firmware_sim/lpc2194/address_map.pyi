# Generated from firmware_sim/lpc2194/address_map.py and firmware_sim/lpc2194/address_map.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.firmware_sim.arm7.core import Device
from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.lpc2194.board import ImageBoard
from ranger_sim.foundation.user_error import UserError
from typing import Any
from typing import final

BLOCK_BITS: int
BLOCKS: int
NAME_OF_ACCESS: dict[int, str]

class NotModelledAccess(UserError):
    address: Any
    pc: Any
    def __init__(self, text: Any, address: Any, pc: Any) -> None: ...

@final
class AddressMap(Device):
    board: ImageBoard
    places: list[Any]
    fast_gpio: Block
    vic: Block
    touched: int
    looks: int
    def __init__(self, board: ImageBoard) -> None: ...
    def add(self, block: Any) -> None: ...
    def blocks(self) -> list[Any]: ...
    def find(self, address: int) -> Block: ...
    def read(self, address: int, size: int) -> int: ...
    def peek(self, address: int, size: int) -> int: ...
    def write(self, address: int, size: int, value: int) -> int: ...
    def fail(self, address: Any, size: Any, writing: Any, value: Any, why: Any) -> None: ...
