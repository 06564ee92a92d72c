"""The display of two lines of eight characters: the queues that feed it slowly, and its pins.

The firmware keeps four queues of 100 characters, one per quarter of four places, and serves the lowest
quarter first. Each character takes a cursor command, 50 ms, the data, 1 ms: about 20 characters a second.
Place p has the device address 0x40 (p / 8) + p mod 8. Source: robot.md N4.11; the device is
firmware_sim/peripherals/character_display.py.
"""

import array

import cython

from ranger_sim.boards.modules.front_panel import DISPLAY_DATA, DISPLAY_ENABLE, DISPLAY_RS, DISPLAY_RW
from ranger_sim.boards.modules.receiver import Receiver
from ranger_sim.datatable.generated import errors
from ranger_sim.firmware_sim.peripherals.gpio import Gpio

START_COMMANDS = (0x38, 0x0C, 0x06, 0x01, 0x02)  # 8 bits and 2 lines, on, move right, clear, home
QUEUES = 4
QUEUE_CHARACTERS = 100
CURSOR_WAIT_MS = 50
DATA_WAIT_MS = 1
PLACES, PLACES_PER_LINE, PLACES_PER_QUARTER = 16, 8, 4
IDLE, CURSOR_SET, CHARACTER_WRITTEN = 0, 1, 2  # states of the firmware's side
SET_ADDRESS = 0x80  # the command that moves the cursor
SECOND_LINE = 0x40  # the address at which it begins


@cython.cclass
class Lcd:
    """The firmware's side. `tick` belongs into the millisecond interrupt; quarters come by LcdQuarter."""

    countdown: cython.longlong
    state: cython.longlong
    waiting: cython.longlong
    position: cython.longlong
    character: cython.longlong
    gpio: Gpio
    data_pins: cython.longlong[8]
    rs_pin: cython.longlong
    rw_pin: cython.longlong
    enable_pin: cython.longlong
    report: object
    positions: cython.longlong[::1]
    characters: cython.longlong[::1]
    reads: cython.longlong[::1]
    counts: cython.longlong[::1]
    code_full: cython.longlong
    code_position: cython.longlong
    written: cython.longlong
    lost: cython.longlong

    def __init__(self, gpio: Gpio, report) -> None:
        self.gpio = gpio
        self.report = report
        self.data_pins = list(DISPLAY_DATA)
        self.rs_pin, self.rw_pin, self.enable_pin = DISPLAY_RS, DISPLAY_RW, DISPLAY_ENABLE
        for byte in START_COMMANDS:  # ROBOT PARITY: without the pauses between them, before the first slot
            self._write(0, byte)
        self.positions = array.array("q", [0]) * (QUEUES * QUEUE_CHARACTERS)
        self.characters = array.array("q", [0]) * (QUEUES * QUEUE_CHARACTERS)
        self.reads = array.array("q", [0]) * QUEUES
        self.counts = array.array("q", [0]) * QUEUES
        self.state = IDLE
        self.countdown = 0
        self.position = 0
        self.character = 0
        self.waiting = 0
        self.code_full = errors.LCD_STR_OF
        self.code_position = errors.LCD_POS_OOB
        self.written = 0
        self.lost = 0

    @cython.ccall
    def put(self, position: cython.longlong, character: cython.longlong) -> cython.bint:
        """Queue one character for place 0-15; False and an error when the place or the queue is wrong."""
        queue: cython.longlong
        slot: cython.longlong
        if position < 0 or position >= PLACES:
            self.report(self.code_position)
            return False
        queue = position // PLACES_PER_QUARTER
        if self.counts[queue] >= QUEUE_CHARACTERS:
            self.lost += 1
            self.report(self.code_full)
            return False
        slot = queue * QUEUE_CHARACTERS + (self.reads[queue] + self.counts[queue]) % QUEUE_CHARACTERS
        self.positions[slot] = position
        self.characters[slot] = character & 0xFF
        self.counts[queue] += 1
        self.waiting += 1
        return True

    @cython.ccall
    def set_quarter(self, quarter: cython.longlong, word: cython.longlong) -> cython.longlong:
        """Queue the four characters of `word`, first in byte 0, for quarter 0-3; returns how many fit."""
        i: cython.longlong
        n: cython.longlong = 0
        for i in range(PLACES_PER_QUARTER):
            if self.put(quarter * PLACES_PER_QUARTER + i, (word >> (8 * i)) & 0xFF):
                n += 1
        return n

    @cython.cfunc
    def _write(self, rs: cython.longlong, byte: cython.longlong) -> cython.int:
        """A byte over the pins: a character with `rs`, else a command."""
        gpio: Gpio = self.gpio
        bit: cython.longlong
        gpio.write(self.rs_pin, rs)
        gpio.write(self.rw_pin, 0)
        gpio.write(self.enable_pin, 1)
        for bit in range(8):
            gpio.write(self.data_pins[bit], byte >> bit & 1)
        gpio.write(self.enable_pin, 0)
        return 0

    @cython.ccall
    def tick(self) -> cython.longlong:
        """One millisecond: at most one byte to the device; returns the bytes written."""
        queue: cython.longlong
        slot: cython.longlong
        if self.countdown > 0:
            self.countdown -= 1
            if self.countdown > 0:
                return 0
        if self.state == CURSOR_SET:
            self._write(1, self.character)
            self.written += 1
            self.state = CHARACTER_WRITTEN
            self.countdown = DATA_WAIT_MS
            return 1
        self.state = IDLE
        if self.waiting == 0:
            return 0
        queue = 0
        while self.counts[queue] == 0:
            queue += 1
        slot = queue * QUEUE_CHARACTERS + self.reads[queue]
        self.position = self.positions[slot]
        self.character = self.characters[slot]
        self.reads[queue] = (self.reads[queue] + 1) % QUEUE_CHARACTERS
        self.counts[queue] -= 1
        self.waiting -= 1
        self._write(0, SET_ADDRESS + SECOND_LINE * (self.position // PLACES_PER_LINE) + self.position % PLACES_PER_LINE)
        self.state = CURSOR_SET
        self.countdown = CURSOR_WAIT_MS
        return 1


@cython.cclass
class LcdQuarter(Receiver):
    """Takes UI_SET_LCD_QUAD_n: four characters for `quarter` 0-3 of the display."""

    lcd: Lcd
    quarter: cython.longlong

    def __init__(self, lcd: Lcd, quarter) -> None:
        Receiver.__init__(self)
        self.lcd = lcd
        self.quarter = quarter

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        """Take a frame; the time word is not used."""
        self.frames += 1
        self.lcd.set_quarter(self.quarter, value_word)
