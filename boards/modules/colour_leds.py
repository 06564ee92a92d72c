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
TRANSFERS_PER_LED = 3
DARK, WHITE = 0, 0xFFFFFF  # command words
DEVICES, PORTS = 2, 9
OFF, FULLY_ON = 1, 0  # values of a port
DIMMEST, BRIGHTEST = 3, 254  # levels that are duty steps
OUTPUT_CONFIGURATION = 0x10
SHUTDOWN_CONFIGURATION = 0x0A
# 32 bits at 15 Mbit/s are 128 cycles of 60 MHz, which the program waits for, and about 70 more to build the
# words and move the select pin (chosen by us, because no listing says)
CYCLES_PER_WRITE = 200


class ColourLeds:
    """Both devices' registers as the SPI writes leave them."""

    def __init__(self) -> None:
        self.ports = array.array("q", [OFF]) * (DEVICES * PORTS)
        self.configuration = array.array("q", [0]) * DEVICES
        self.writes = 0
        for register in (OUTPUT_CONFIGURATION, SHUTDOWN_CONFIGURATION):
            for device in range(DEVICES):
                self.write(device, register, 1)

    def write(self, device: cython.longlong, register: cython.longlong, value: cython.longlong) -> cython.void:
        """One transfer: `register` of one device gets `value`, the other device a no-operation."""
        self.writes += 1
        if 0 <= register < PORTS:
            self.ports[device * PORTS + register] = value & 0xFF
        elif register == OUTPUT_CONFIGURATION:
            self.configuration[device] = value & 0xFF

    def set_colour(self, led: cython.longlong, colour: cython.longlong, level: cython.longlong) -> cython.longlong:
        """Brightness 0-255 of one colour of light 0-5; returns the number of transfers, 1."""
        value: cython.longlong = level
        if level < DIMMEST:
            value = OFF
        elif level > BRIGHTEST:
            value = FULLY_ON
        self.write(led // 3, (3 * led + colour) % PORTS, value)
        return 1

    def set_led(self, led: cython.longlong, word: cython.longlong) -> cython.longlong:
        """The three colours of light 0-5 from a command word; returns the number of transfers, 3."""
        self.set_colour(led, RED, word & 0xFF)
        self.set_colour(led, GREEN, (word >> 8) & 0xFF)
        self.set_colour(led, BLUE, (word >> 16) & 0xFF)
        return TRANSFERS_PER_LED

    def level(self, led: cython.longlong, colour: cython.longlong) -> cython.longlong:
        """Brightness that an eye sees of one colour of light 0-5: 0 (off) ... 255 (fully on)."""
        value: cython.longlong = self.ports[PORTS * (led // 3) + (3 * led + colour) % PORTS]
        if value == OFF:
            return 0
        if value == FULLY_ON:
            return 255
        return value

    def colour(self, led: cython.longlong) -> cython.longlong:
        """What light 0-5 shows, as a command word: 8 bits each of red (lowest), green and blue."""
        return self.level(led, RED) | (self.level(led, GREEN) << 8) | (self.level(led, BLUE) << 16)


class LedReceiver(Receiver):
    """Takes UI_SET_LED_n: the colour of light `led` 0-5. Its cycles are those of the transfers."""

    def __init__(self, leds: ColourLeds, led) -> None:
        Receiver.__init__(self, TRANSFERS_PER_LED * CYCLES_PER_WRITE)
        self.leds = leds
        self.led = led

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        """A frame came; the time word is not looked at."""
        self.frames += 1
        self.leds.set_led(self.led, value_word)
