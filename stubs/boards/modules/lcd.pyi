# Generated from boards/modules/lcd.py and boards/modules/lcd.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.boards.modules.receiver import Receiver
from typing import Any

START_COMMANDS: tuple[int, ...]
QUEUES: int
QUEUE_CHARACTERS: int
CURSOR_WAIT_MS: int
DATA_WAIT_MS: int
PLACES: int
PLACES_PER_LINE: int
PLACES_PER_QUARTER: int
IDLE: int
CURSOR_SET: int
CHARACTER_WRITTEN: int
SPACE: int
SET_ADDRESS: int
ENTRY_MODE: int
DISPLAY_ON: int
FUNCTION_SET: int
HOME: int
CLEAR: int
SECOND_LINE: int

class CharacterDisplay:
    memory: MutableSequence[int]
    address: int
    commands: int
    characters: int
    on: bool
    two_lines: bool
    wide_bus: bool
    increment: int
    def __init__(self) -> None: ...
    def command(self, byte: int) -> None: ...
    def data(self, byte: int) -> None: ...
    def lines(self) -> Any: ...

class Lcd:
    countdown: int
    state: int
    waiting: int
    position: int
    character: int
    display: CharacterDisplay
    report: Any
    positions: MutableSequence[int]
    characters: MutableSequence[int]
    reads: MutableSequence[int]
    counts: MutableSequence[int]
    code_full: int
    code_position: int
    written: int
    lost: int
    def __init__(self, report: Any) -> None: ...
    def text(self) -> str: ...
    def put(self, position: int, character: int) -> bool: ...
    def set_quarter(self, quarter: int, word: int) -> int: ...
    def tick(self) -> int: ...

class LcdQuarter(Receiver):
    lcd: Lcd
    quarter: int
    def __init__(self, lcd: Lcd, quarter: int) -> None: ...
    def deliver(self, value_word: int, time_word: int) -> None: ...
