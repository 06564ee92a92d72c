# Generated from boards/modules/colour_leds.py and boards/modules/colour_leds.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.receiver import Receiver
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
from ranger_sim.firmware_sim.peripherals.ssp import SspMaster

TRANSFERS_PER_LED: int
DARK: int
WHITE: int
OFF: int
FULLY_ON: int
DIMMEST: int
BRIGHTEST: int
ALL_PORTS: int
NO_OPERATION: int
CYCLES_PER_WRITE: int

class ColourLeds:
    ssp: SspMaster
    gpio: Gpio
    select_pin: int
    def __init__(self, ssp: SspMaster, gpio: Gpio) -> None: ...
    def write(self, device: int, register: int, value: int) -> int: ...
    def set_colour(self, led: int, colour: int, level: int) -> int: ...
    def set_led(self, led: int, word: int) -> int: ...

class LedReceiver(Receiver):
    leds: ColourLeds
    led: int
    def __init__(self, leds: ColourLeds, led: int) -> None: ...
    def deliver(self, value_word: int, time_word: int) -> None: ...
