"""The user interface board's front panel: the devices on its processor's pins for a person, and their state as words.

It knows levels of pins, words on the SSP and the PWM unit's registers, of any program: robot.md N4.11. Its `WORDS`
words, which others may read at any time: the display's sixteen characters (0 while it is off), the six colour lights
as command words (red in the lowest byte), the tone in Hz (0: silence), the sync light, the keys that are down and the
lights next to the processor that are lit (a bit each: green, red, blue).
"""

import array
from typing import Final

import cython

from ranger_sim.boards.modules.mcu_led import PINS as PINS_OF_LEDS
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.peripherals.character_display import CharacterDisplay
from ranger_sim.firmware_sim.peripherals.gpio import p0, p1
from ranger_sim.firmware_sim.peripherals.led_drivers import LedDrivers
from ranger_sim.firmware_sim.peripherals.pwm import Pwm

CHARACTERS: Final = 0
LIGHTS: Final = 16
TONE_HZ: Final = 22
SYNC: Final = 23
KEYS: Final = 24
LEDS: Final = 25
WORDS: Final = 26
CHARACTERS_PER_LINE: Final = 8
LIGHT_COUNT: Final = 6
LIGHTS_PER_DRIVER: Final = 3
PORTS_USED: Final = 9  # of each driver

# The display: DB0 ... DB7 and its three lines of control
DISPLAY_DATA = tuple(p0(bit) for bit in range(8))
DISPLAY_RS, DISPLAY_RW, DISPLAY_ENABLE = p0(15), p0(10), p0(11)
# Two MAX6966 on the SSP; light l has port (3 l + c) mod 9 of driver l / 3, c = 0 blue, 1 green, 2 red
LIGHTS_SELECT = p0(20)
DRIVERS = 2
BLUE, GREEN, RED = 0, 1, 2
KEY_PINS = (p1(18), p0(12), p0(13), p0(28), p1(16), p0(30))  # active high
SYNC_PIN = p0(16)  # low lights it
LED_PINS = tuple(PINS_OF_LEDS[colour] for colour in ("green", "red", "blue"))  # side by side; low lights them
# The buzzer is a piezo on PWM5, P0.21
BUZZER_CHANNEL = 5


@cython.final
@cython.cclass
class FrontPanel(Peripheral):
    """The panel's lights, sound and keys, at the pins of `chip`. `ssp`: the device on its SSP, the lights."""

    display: CharacterDisplay
    ssp: LedDrivers
    words: cython.longlong[::1]
    bit_of: cython.longlong[64]
    enable_pin: cython.longlong
    select_pin: cython.longlong
    sync_pin: cython.longlong
    first_led: cython.longlong
    last_led: cython.longlong

    def __init__(self, chip) -> None:
        Peripheral.__init__(self, chip)
        self.display = CharacterDisplay(chip, DISPLAY_DATA, DISPLAY_RS, DISPLAY_RW, DISPLAY_ENABLE)
        self.ssp = LedDrivers(chip, LIGHTS_SELECT, DRIVERS)
        self.words = array.array("q", [0]) * WORDS
        self.bit_of = [0] * 64
        for pins in (KEY_PINS, LED_PINS):
            for number, pin in enumerate(pins):
                self.bit_of[pin] = 1 << number
        self.enable_pin = DISPLAY_ENABLE
        self.select_pin = LIGHTS_SELECT
        self.sync_pin = SYNC_PIN
        self.first_led, self.last_led = LED_PINS[0], LED_PINS[-1]
        for pin in (DISPLAY_ENABLE, LIGHTS_SELECT, SYNC_PIN, *KEY_PINS, *LED_PINS):
            chip.followers[pin] = self
        chip.pwm_follower = self

    def on_level(self, pin: cython.longlong, level: cython.longlong) -> cython.int:
        """Take a change of a pin."""
        if pin == self.select_pin:
            if self.ssp.on_select(level):
                self._show_lights()
        elif pin == self.enable_pin:
            if self.display.on_enable(level):
                self._show_characters()
        elif pin == self.sync_pin:
            self.words[SYNC] = 1 - level
        elif self.first_led <= pin <= self.last_led:
            self._set_bit(LEDS, self.bit_of[pin], 1 - level)
        else:
            self._set_bit(KEYS, self.bit_of[pin], level)
        return 0

    def on_pwm(self, pwm: object) -> cython.int:
        """Set the tone to that of PWM5, if it has pulses: pins without edges make no sound."""
        unit: Pwm = pwm
        hertz: cython.longlong = 0
        if unit.driven >> BUZZER_CHANNEL & 1 and 0 < unit.latched_MR5 < unit.latched_MR0:
            hertz = (2 * unit.hz + unit.latched_MR0) // (2 * unit.latched_MR0)
        self.words[TONE_HZ] = hertz
        return 0

    @cython.cfunc
    def _set_bit(self, word: cython.longlong, bit: cython.longlong, level: cython.longlong) -> cython.int:
        self.words[word] = self.words[word] | bit if level else self.words[word] & ~bit
        return 0

    @cython.cfunc
    def _show_characters(self) -> cython.int:
        """Update the words after the display has taken a byte."""
        i: cython.longlong
        for i in range(CHARACTERS_PER_LINE):
            self.words[CHARACTERS + i] = self.display.shown(0, i)
            self.words[CHARACTERS + CHARACTERS_PER_LINE + i] = self.display.shown(1, i)
        return 0

    @cython.cfunc
    def _show_lights(self) -> cython.int:
        """Update the words after the drivers have taken their bits."""
        light: cython.longlong
        for light in range(LIGHT_COUNT):
            self.words[LIGHTS + light] = (
                self._level(light, RED) | self._level(light, GREEN) << 8 | self._level(light, BLUE) << 16
            )
        return 0

    @cython.cfunc
    def _level(self, light: cython.longlong, colour: cython.longlong) -> cython.longlong:
        """Brightness of one colour of a light, 0 ... 255."""
        return self.ssp.level(light // LIGHTS_PER_DRIVER, (3 * light + colour) % PORTS_USED)

    def move(self, words) -> None:
        """Keep the words, with their values, in `words` from now on: memory that processes share."""
        words[:] = memoryview(self.words)
        self.words = words

    # --- for readers within the process -------------------------------------------------------------------

    def text(self) -> str:
        """Both lines as a person reads them, joined by a line feed; anything but printable ASCII shows as a space."""
        codes = [self.words[CHARACTERS + place] for place in range(2 * CHARACTERS_PER_LINE)]
        shown = "".join(chr(code) if 0x20 <= code < 0x7F else " " for code in codes)
        return f"{shown[:CHARACTERS_PER_LINE]}\n{shown[CHARACTERS_PER_LINE:]}"

    @cython.ccall
    def colour(self, light: cython.longlong) -> cython.longlong:
        """What light 0-5 shows, as a command word: 8 bits each of red (lowest), green and blue."""
        return self.words[LIGHTS + light]

    @property
    def hertz(self) -> int:
        """The present tone; 0: silence."""
        return self.words[TONE_HZ]
