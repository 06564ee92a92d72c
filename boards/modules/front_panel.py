"""What a person sees, hears and presses on the user interface board, as words that others may read at any instant.

`WORDS` of them: the display's sixteen characters (0 while it is off), the six lights as command words (red in the
lowest byte), the tone in Hz (0: silence), the sync light, and the keys that are down, a bit each.
"""

import array

import cython

from ranger_sim.boards.modules.buzzer import Buzzer
from ranger_sim.boards.modules.colour_leds import ColourLeds
from ranger_sim.boards.modules.keypad import Keypad
from ranger_sim.boards.modules.lcd import Lcd
from ranger_sim.boards.modules.sync_light import SyncLight

if not cython.compiled:
    CHARACTERS = 0
    LIGHTS = 16
    TONE_HZ = 22
    SYNC = 23
    KEYS = 24
    WORDS = 25
    CHARACTERS_PER_LINE = 8
    SECOND_LINE_AT = 0x40
    LIGHT_COUNT = 6


class FrontPanel:
    """`show` brings `words` up to date; it costs the robot nothing, as a look at it does."""

    def __init__(self, lcd: Lcd, leds: ColourLeds, buzzer: Buzzer, sync_light: SyncLight, keypad: Keypad) -> None:
        self.lcd = lcd
        self.leds = leds
        self.buzzer = buzzer
        self.sync_light = sync_light
        self.keypad = keypad
        self.words = array.array("q", [0]) * WORDS
        self.seen_commands = -1  # what was shown last: characters and lights change rarely
        self.seen_characters = -1
        self.seen_writes = -1

    def show(self) -> None:
        """Once per slot."""
        i: cython.longlong
        display = self.lcd.display
        if display.commands != self.seen_commands or display.characters != self.seen_characters:
            self.seen_commands = display.commands
            self.seen_characters = display.characters
            for i in range(CHARACTERS_PER_LINE):
                self.words[CHARACTERS + i] = display.memory[i] if display.on else 0
                self.words[CHARACTERS + CHARACTERS_PER_LINE + i] = (
                    display.memory[SECOND_LINE_AT + i] if display.on else 0
                )
        if self.leds.writes != self.seen_writes:
            self.seen_writes = self.leds.writes
            for i in range(LIGHT_COUNT):
                self.words[LIGHTS + i] = self.leds.colour(i)
        self.words[TONE_HZ] = self.buzzer.hertz
        self.words[SYNC] = 1 if self.sync_light.lit else 0
        self.words[KEYS] = self.keypad.buttons()

    def move(self, words) -> None:
        """The words stand in `words` from now on, as they are: memory that processes share."""
        words[:] = memoryview(self.words)
        self.words = words
