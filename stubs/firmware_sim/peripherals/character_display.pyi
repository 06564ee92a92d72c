# Generated from firmware_sim/peripherals/character_display.py and firmware_sim/peripherals/character_display.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.peripheral import Peripheral
from typing import Any
from typing import final

SPACE: int
SET_ADDRESS: int
SET_SHAPE_ADDRESS: int
FUNCTION_SET: int
SHIFT: int
DISPLAY_CONTROL: int
ENTRY_MODE: int
HOME: int
CLEAR: int
SECOND_LINE: int
LINE_LENGTH: int
ONE_LINE_LENGTH: int

@final
class CharacterDisplay(Peripheral):
    data_pins: MutableSequence[int]
    rs: int
    rw: int
    enable: int
    enabled: bool
    in_shapes: bool
    wide_bus: bool
    two_lines: bool
    on: bool
    follows: bool
    memory: MutableSequence[int]
    address: int
    increment: int
    shift: int
    half: int
    commands: int
    characters: int
    def __init__(self, chip: Any, data: Any, rs: int, rw: int, enable: int) -> None: ...
    def on_enable(self, level: int) -> bool: ...
    def write(self, rs: int, byte: int) -> int: ...
    def shown(self, line: int, place: int) -> int: ...
