# Generated from boards/modules/sync_light.py and boards/modules/sync_light.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.colour_leds import ColourLeds
from ranger_sim.boards.modules.keypad import Keypad
from ranger_sim.firmware_sim.peripherals.gpio import Gpio

SYNC_KEY: int
SYNC_LED: int
TOGGLE_SLOTS: int
CELL_MS: int
FLASH_MS: int
CELLS_PER_PATTERN: int
PATTERNS: int

class SyncLight:
    gpio: Gpio
    keypad: Keypad
    leds: ColourLeds
    running: bool
    lit: bool
    held_slots: int
    milliseconds: int
    flashes: int
    pin: int
    def __init__(self, gpio: Gpio, keypad: Keypad, leds: ColourLeds) -> None: ...
    def watch_key(self) -> int: ...
    def update(self) -> int: ...
    def _show(self, on: bool) -> None: ...
