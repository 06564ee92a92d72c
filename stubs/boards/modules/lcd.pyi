# Generated from boards/modules/lcd.py and boards/modules/lcd.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.boards.modules.receiver import Receiver
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
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
SET_ADDRESS: int
SECOND_LINE: int

class Lcd:
    countdown: int
    state: int
    waiting: int
    position: int
    character: int
    gpio: Gpio
    data_pins: MutableSequence[int]
    rs_pin: int
    rw_pin: int
    enable_pin: int
    report: Any
    positions: MutableSequence[int]
    characters: MutableSequence[int]
    reads: MutableSequence[int]
    counts: MutableSequence[int]
    code_full: int
    code_position: int
    written: int
    lost: int
    def __init__(self, gpio: Gpio, report: Any) -> None: ...
    def put(self, position: int, character: int) -> bool: ...
    def set_quarter(self, quarter: int, word: int) -> int: ...
    def tick(self) -> int: ...

class LcdQuarter(Receiver):
    lcd: Lcd
    quarter: int
    def __init__(self, lcd: Lcd, quarter: int) -> None: ...
    def deliver(self, value_word: int, time_word: int) -> None: ...
