# Generated from boards/modules/colour_leds.py and boards/modules/colour_leds.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.boards.modules.receiver import Receiver

BLUE: int
GREEN: int
RED: int
TRANSFERS_PER_LED: int
DARK: int
WHITE: int
DEVICES: int
PORTS: int
OFF: int
FULLY_ON: int
DIMMEST: int
BRIGHTEST: int
OUTPUT_CONFIGURATION: int
SHUTDOWN_CONFIGURATION: int
CYCLES_PER_WRITE: int

class ColourLeds:
    ports: MutableSequence[int]
    configuration: MutableSequence[int]
    writes: int
    def __init__(self) -> None: ...
    def write(self, device: int, register: int, value: int) -> None: ...
    def set_colour(self, led: int, colour: int, level: int) -> int: ...
    def set_led(self, led: int, word: int) -> int: ...
    def level(self, led: int, colour: int) -> int: ...
    def colour(self, led: int) -> int: ...

class LedReceiver(Receiver):
    leds: ColourLeds
    led: int
    def __init__(self, leds: ColourLeds, led: int) -> None: ...
    def deliver(self, value_word: int, time_word: int) -> None: ...
