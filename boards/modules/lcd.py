"""The display of two lines of eight characters: the device, and the queues that feed it slowly.

The firmware keeps four queues of 100 characters, one per quarter of four places, and serves the lowest
quarter first. Each character takes a cursor command, 50 ms, the data, 1 ms: about 20 characters a second.
Place p has the device address 0x40 (p / 8) + p mod 8. Source: robot.md N4.11; the device is
of the HD44780 type, commands as in its data sheet.
"""

import array

import cython

from ranger_sim.boards.modules.receiver import Receiver
from ranger_sim.datatable.generated import errors

START_COMMANDS = (0x38, 0x0C, 0x06, 0x01, 0x02)  # 8 bits and 2 lines, on, move right, clear, home
QUEUES = 4
QUEUE_CHARACTERS = 100
CURSOR_WAIT_MS = 50
DATA_WAIT_MS = 1
PLACES, PLACES_PER_LINE, PLACES_PER_QUARTER = 16, 8, 4
IDLE, CURSOR_SET, CHARACTER_WRITTEN = 0, 1, 2  # states of the firmware's side
SPACE = 0x20
# Commands, each named by the highest bit that is set; the second line begins at this address.
SET_ADDRESS, ENTRY_MODE, DISPLAY_ON, FUNCTION_SET, HOME, CLEAR = 0x80, 0x04, 0x08, 0x20, 0x02, 0x01
SECOND_LINE = 0x40


class CharacterDisplay:
    """The device: 80 bytes of memory, an address, and what a person reads.

    ROBOT PARITY: a byte goes over as one call; on the robot eight data pins, R/S, R/W and E make it.
    """

    def __init__(self) -> None:
        self.memory = array.array("q", [SPACE]) * 128
        self.address = 0
        self.commands = 0
        self.characters = 0
        self.on = False
        self.two_lines = False
        self.wide_bus = False
        self.increment = 1

    def command(self, byte: cython.longlong) -> None:
        """A byte with R/S low: the highest bit that is set says what it is."""
        i: cython.longlong
        self.commands += 1
        if byte & SET_ADDRESS:
            self.address = byte & 0x7F
        elif byte & 0x40:
            pass  # character shapes: the firmware defines none
        elif byte & FUNCTION_SET:
            self.wide_bus = (byte & 0x10) != 0
            self.two_lines = (byte & 0x08) != 0
        elif byte & 0x10:
            pass  # shifting the whole display: not used
        elif byte & DISPLAY_ON:
            self.on = (byte & 0x04) != 0
        elif byte & ENTRY_MODE:
            self.increment = 1 if byte & 0x02 else -1
        elif byte & HOME:
            self.address = 0
        elif byte & CLEAR:
            for i in range(128):
                self.memory[i] = SPACE
            self.address = 0

    def data(self, byte: cython.longlong) -> None:
        """A byte with R/S high: a character at the address, which then moves on."""
        self.characters += 1
        self.memory[self.address] = byte & 0xFF
        self.address = (self.address + self.increment) & 0x7F

    def lines(self):
        """What a person reads, two strings of eight; a byte that is no printable ASCII shows as a space."""
        if not self.on:
            return (" " * 8, " " * 8)
        shown = []
        for start in (0, SECOND_LINE):
            shown.append("".join(chr(b) if 0x20 <= b < 0x7F else " " for b in self.memory[start : start + 8]))
        return tuple(shown)


class Lcd:
    """The firmware's side. `tick` belongs into the millisecond interrupt; quarters come by LcdQuarter."""

    def __init__(self, report) -> None:
        self.report = report
        self.display = CharacterDisplay()
        for byte in START_COMMANDS:
            self.display.command(byte)
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

    def text(self) -> str:
        """Both lines as a person reads them, joined by a line feed."""
        return "\n".join(self.display.lines())

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

    def set_quarter(self, quarter: cython.longlong, word: cython.longlong) -> cython.longlong:
        """Queue the four characters of `word`, first in byte 0, for quarter 0-3; returns how many fit."""
        i: cython.longlong
        n: cython.longlong = 0
        for i in range(PLACES_PER_QUARTER):
            if self.put(quarter * PLACES_PER_QUARTER + i, (word >> (8 * i)) & 0xFF):
                n += 1
        return n

    def tick(self) -> cython.longlong:
        """One millisecond: at most one byte to the device; returns the bytes written."""
        queue: cython.longlong
        slot: cython.longlong
        if self.countdown > 0:
            self.countdown -= 1
            if self.countdown > 0:
                return 0
        if self.state == CURSOR_SET:
            self.display.data(self.character)
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
        self.display.command(
            SET_ADDRESS + SECOND_LINE * (self.position // PLACES_PER_LINE) + self.position % PLACES_PER_LINE
        )
        self.state = CURSOR_SET
        self.countdown = CURSOR_WAIT_MS
        return 1


class LcdQuarter(Receiver):
    """Takes UI_SET_LCD_QUAD_n: four characters for `quarter` 0-3 of the display."""

    def __init__(self, lcd: Lcd, quarter) -> None:
        Receiver.__init__(self)
        self.lcd = lcd
        self.quarter = quarter

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        """A frame came; the time word is not looked at."""
        self.frames += 1
        self.lcd.set_quarter(self.quarter, value_word)
