"""Six lights of three colours on two MAX6966 drivers in a chain, written over the SSP.

Light l has port (3 l + c) mod 9 of device l / 3, c = 0 blue, 1 green, 2 red. A command word has red in byte
0, green in byte 1, blue in byte 2. Port value 1 is off, 0 is fully on, 3-254 are duty steps; levels below 3
become off and above 254 fully on. Source: robot.md N4.11; the devices are
firmware_sim/peripherals/led_drivers.py.
"""

import cython

from ranger_sim.boards.modules.front_panel import BLUE, GREEN, LIGHTS_PER_DRIVER, LIGHTS_SELECT, PORTS_USED, RED
from ranger_sim.boards.modules.receiver import Receiver
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
from ranger_sim.firmware_sim.peripherals.led_drivers import CONFIGURATION, RUN
from ranger_sim.firmware_sim.peripherals.ssp import SspMaster

TRANSFERS_PER_LED = 3
DARK, WHITE = 0, 0xFFFFFF  # command words
OFF, FULLY_ON = 1, 0  # values of a port
DIMMEST, BRIGHTEST = 3, 254  # levels that are duty steps
ALL_PORTS, NO_OPERATION = 0x0A, 0x2000  # a register, and a whole word
# 32 bits at 15 Mbit/s are 128 cycles of 60 MHz, which the program waits for, and about 70 more to build the
# words and move the select pin (chosen by us, because no listing says)
CYCLES_PER_WRITE = 200


@cython.cclass
class ColourLeds:
    """The firmware's side: `ssp` is the port as a master, `gpio` has the drivers' select pin."""

    ssp: SspMaster
    gpio: Gpio
    select_pin: cython.longlong

    def __init__(self, ssp: SspMaster, gpio: Gpio) -> None:
        self.ssp = ssp
        self.gpio = gpio
        self.select_pin = LIGHTS_SELECT
        gpio.write(LIGHTS_SELECT, 1)
        self._send(CONFIGURATION << 8 | RUN, CONFIGURATION << 8 | RUN)
        self._send(ALL_PORTS << 8 | OFF, ALL_PORTS << 8 | OFF)

    @cython.cfunc
    def _send(self, far: cython.longlong, near: cython.longlong) -> cython.int:
        """One transfer: 16 bits for each driver."""
        self.gpio.write(self.select_pin, 0)
        self.ssp.word(far)
        self.ssp.word(near)
        self.gpio.write(self.select_pin, 1)
        return 0

    @cython.ccall
    def write(self, device: cython.longlong, register: cython.longlong, value: cython.longlong) -> cython.int:
        """`register` of one device gets `value`, the other device a no-operation."""
        word: cython.longlong = register << 8 | value & 0xFF
        if device == 0:
            self._send(NO_OPERATION, word)
        else:
            self._send(word, NO_OPERATION)
        return 0

    @cython.ccall
    def set_colour(self, led: cython.longlong, colour: cython.longlong, level: cython.longlong) -> cython.longlong:
        """Brightness 0-255 of one colour of light 0-5; returns the number of transfers, 1."""
        value: cython.longlong = level
        if level < DIMMEST:
            value = OFF
        elif level > BRIGHTEST:
            value = FULLY_ON
        self.write(led // LIGHTS_PER_DRIVER, (3 * led + colour) % PORTS_USED, value)
        return 1

    @cython.ccall
    def set_led(self, led: cython.longlong, word: cython.longlong) -> cython.longlong:
        """The three colours of light 0-5 from a command word; returns the number of transfers, 3."""
        self.set_colour(led, RED, word & 0xFF)
        self.set_colour(led, GREEN, (word >> 8) & 0xFF)
        self.set_colour(led, BLUE, (word >> 16) & 0xFF)
        return TRANSFERS_PER_LED


@cython.cclass
class LedReceiver(Receiver):
    """Takes UI_SET_LED_n: the colour of light `led` 0-5. Its cycles are those of the transfers."""

    leds: ColourLeds
    led: cython.longlong

    def __init__(self, leds: ColourLeds, led) -> None:
        Receiver.__init__(self, TRANSFERS_PER_LED * CYCLES_PER_WRITE)
        self.leds = leds
        self.led = led

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        """Take a frame; the time word is not used."""
        self.frames += 1
        self.leds.set_led(self.led, value_word)
