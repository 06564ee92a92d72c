# Generated from boards/modules/front_panel.py and boards/modules/front_panel.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.peripherals.character_display import CharacterDisplay
from ranger_sim.firmware_sim.peripherals.led_drivers import LedDrivers
from typing import Any
from typing import final

CHARACTERS: int
LIGHTS: int
TONE_HZ: int
SYNC: int
KEYS: int
LEDS: int
WORDS: int
CHARACTERS_PER_LINE: int
LIGHT_COUNT: int
LIGHTS_PER_DRIVER: int
PORTS_USED: int
DISPLAY_DATA: Any
DISPLAY_RS: Any
DISPLAY_RW: Any
DISPLAY_ENABLE: Any
LIGHTS_SELECT: Any
DRIVERS: int
BLUE: int
GREEN: int
RED: int
KEY_PINS: tuple[Any, ...]
SYNC_PIN: Any
LED_PINS: Any
BUZZER_CHANNEL: int

@final
class FrontPanel(Peripheral):
    display: CharacterDisplay
    ssp: LedDrivers
    words: MutableSequence[int]
    bit_of: MutableSequence[int]
    enable_pin: int
    select_pin: int
    sync_pin: int
    first_led: int
    last_led: int
    def __init__(self, chip: Any) -> None: ...
    def on_level(self, pin: int, level: int) -> int: ...
    def on_pwm(self, pwm: Any) -> int: ...
    def move(self, words: Any) -> None: ...
    def text(self) -> str: ...
    def colour(self, light: int) -> int: ...
    @property
    def hertz(self) -> int: ...
