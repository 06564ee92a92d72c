"""Six lights of three colours on two MAX6966 drivers in a chain, written over SPI.

Light l has port (3 l + c) mod 9 of device l / 3, c = 0 blue, 1 green, 2 red. A command word has red in byte
0, green in byte 1, blue in byte 2. Port value 1 is off, 0 is fully on, 3-254 are duty steps; levels below 3
become off and above 254 fully on. Source: robot.md N4.11; MAX6966 data sheet.
"""

import array

import cython

from ranger_sim.boards.modules.receiver import Receiver

BLUE = 0
GREEN = 1
RED = 2
OUTPUT_CONFIGURATION = 0x10
SHUTDOWN_CONFIGURATION = 0x0A
# 32 bits at 15 Mbit/s are 128 cycles of 60 MHz, which the program waits for, and about 70 more to build the
# words and move the select pin (chosen by us, because no listing says)
CYCLES_PER_WRITE = 200


class ColourLeds:
    """Both devices' registers as the SPI writes leave them."""

    def __init__(self) -> None:
        self.ports = array.array("q", [1]) * 18
        self.configuration = array.array("q", [0]) * 2
        self.writes = 0
        self.write(0, 0x10, 1)
        self.write(1, 0x10, 1)
        self.write(0, 0x0A, 1)
        self.write(1, 0x0A, 1)

    def write(self, device: cython.longlong, register: cython.longlong, value: cython.longlong) -> cython.void:
        """One transfer: `register` of one device gets `value`, the other device a no-operation."""
        self.writes += 1
        if 0 <= register <= 8:
            self.ports[device * 9 + register] = value & 0xFF
        elif register == 0x10:
            self.configuration[device] = value & 0xFF

    def set_colour(self, led: cython.longlong, colour: cython.longlong, level: cython.longlong) -> cython.longlong:
        """Brightness 0-255 of one colour of light 0-5; returns the number of transfers, 1."""
        value: cython.longlong = level
        if level < 3:
            value = 1
        elif level > 254:
            value = 0
        self.write(led // 3, (3 * led + colour) % 9, value)
        return 1

    def set_led(self, led: cython.longlong, word: cython.longlong) -> cython.longlong:
        """The three colours of light 0-5 from a command word; returns the number of transfers, 3."""
        self.set_colour(led, 2, word & 0xFF)
        self.set_colour(led, 1, (word >> 8) & 0xFF)
        self.set_colour(led, 0, (word >> 16) & 0xFF)
        return 3

    def level(self, led: cython.longlong, colour: cython.longlong) -> cython.longlong:
        """Brightness that an eye sees of one colour of light 0-5: 0 (off) ... 255 (fully on)."""
        value: cython.longlong = self.ports[9 * (led // 3) + (3 * led + colour) % 9]
        if value == 1:
            return 0
        if value == 0:
            return 255
        return value

    def colour(self, led: cython.longlong) -> cython.longlong:
        """What light 0-5 shows, as a command word: 8 bits each of red (lowest), green and blue."""
        return self.level(led, 2) | (self.level(led, 1) << 8) | (self.level(led, 0) << 16)


class LedReceiver(Receiver):
    """Takes UI_SET_LED_n: the colour of light `led` 0-5. The transfers' cycles are spent on `chip`."""

    def __init__(self, leds: ColourLeds, led, chip) -> None:
        Receiver.__init__(self)
        self.leds = leds
        self.led = led
        self.chip = chip
        self.cycles = 3 * CYCLES_PER_WRITE

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        """A frame came; the time word is not looked at."""
        self.frames += 1
        self.leds.set_led(self.led, value_word)
        self.chip.spend(self.cycles)
