# Generated from boards/modules/front_panel.py and boards/modules/front_panel.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.boards.modules.buzzer import Buzzer
from ranger_sim.boards.modules.colour_leds import ColourLeds
from ranger_sim.boards.modules.keypad import Keypad
from ranger_sim.boards.modules.lcd import Lcd
from ranger_sim.boards.modules.sync_light import SyncLight
from typing import Any
from typing import final

CHARACTERS: int
LIGHTS: int
TONE_HZ: int
SYNC: int
KEYS: int
WORDS: int
CHARACTERS_PER_LINE: int
SECOND_LINE_AT: int
LIGHT_COUNT: int

@final
class FrontPanel:
    lcd: Lcd
    leds: ColourLeds
    buzzer: Buzzer
    sync_light: SyncLight
    keypad: Keypad
    words: MutableSequence[int]
    seen_commands: int
    seen_characters: int
    seen_writes: int
    def __init__(self, lcd: Lcd, leds: ColourLeds, buzzer: Buzzer, sync_light: SyncLight, keypad: Keypad) -> None: ...
    def show(self) -> None: ...
    def move(self, words: Any) -> None: ...
