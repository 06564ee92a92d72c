# cython: boundscheck=False, wraparound=False
# (addresses are below 128, pins 0 ... 63)
"""A character display of the HD44780 type with two lines, at the pins of a chip: it knows only their levels.

HD44780U data sheet. A byte, or in 4-bit mode half of one on DB7 ... DB4, is taken at the falling edge of E: an
instruction with RS low, a character with RS high. With R/W high the display drives the data pins while E is high.
Not modelled: the shapes of own characters, cursor and blinking, which no code reads.
ROBOT PARITY: each byte is done at once and the busy flag is never set; the device takes 37 us, 1.5 ms to go home.
"""

import array

import cython

from ranger_sim.firmware_sim.peripheral import Peripheral

SPACE = 0x20
# Instructions, each named by the highest bit that is set.
SET_ADDRESS, SET_SHAPE_ADDRESS, FUNCTION_SET, SHIFT = 0x80, 0x40, 0x20, 0x10
DISPLAY_CONTROL, ENTRY_MODE, HOME, CLEAR = 0x08, 0x04, 0x02, 0x01
SECOND_LINE = 0x40  # its first address
LINE_LENGTH = 40  # characters of memory per line, of which the glass shows some
ONE_LINE_LENGTH = 80


@cython.final
@cython.cclass
class CharacterDisplay(Peripheral):
    """`data`: the pins of DB0 ... DB7; RS, R/W and E are one pin each. `memory` has the characters written.

    The owner calls `on_enable` with each change of E (its `Chip.followers`).
    """

    data_pins: cython.longlong[8]
    rs: cython.longlong
    rw: cython.longlong
    enable: cython.longlong
    enabled: cython.bint
    in_shapes: cython.bint
    wide_bus: cython.bint
    two_lines: cython.bint
    on: cython.bint
    follows: cython.bint
    memory: cython.longlong[::1]
    address: cython.longlong
    increment: cython.longlong
    shift: cython.longlong
    half: cython.longlong
    commands: cython.longlong
    characters: cython.longlong

    def __init__(self, chip, data, rs, rw, enable) -> None:
        Peripheral.__init__(self, chip)
        self.data_pins = list(data)
        self.rs = rs
        self.rw = rw
        self.enable = enable
        self.enabled = False
        # as after its reset by itself at power-up
        self.memory = array.array("q", [SPACE]) * 128
        self.address = 0
        self.in_shapes = False  # the address is one of own shapes
        self.wide_bus = True
        self.two_lines = False
        self.on = False
        self.increment = 1
        self.follows = False  # writing shifts what is shown
        self.shift = 0
        self.half = -1  # in 4-bit mode: the first half of a byte, -1 before it
        self.commands = 0
        self.characters = 0

    # --- the pins -----------------------------------------------------------------------------------------

    @cython.ccall
    def on_enable(self, level: cython.longlong) -> cython.bint:
        """Take a new level of E; True when a byte has been taken with it."""
        byte: cython.longlong = 0
        i: cython.longlong
        if self.enabled == (level != 0):
            return False
        self.enabled = level != 0
        if self.chip.pins[self.rw]:
            self._read_out()
            return False
        if self.enabled:
            return False
        for i in range(8):
            byte |= self.chip.pins[self.data_pins[i]] << i
        if not self.wide_bus:
            if self.half < 0:
                self.half = byte >> 4
                return False
            byte = self.half << 4 | byte >> 4
            self.half = -1
        self.write(self.chip.pins[self.rs], byte)
        return True

    @cython.cfunc
    def _read_out(self) -> cython.int:
        """Take a change of E in a read: the display drives the data pins; at the read's end the address moves on."""
        i: cython.longlong
        is_data: cython.bint = self.chip.pins[self.rs] != 0
        byte: cython.longlong = self.memory[self.address] if is_data and not self.in_shapes else 0
        if not is_data:
            byte = self.address  # and not busy
        if not self.enabled:
            if not self.wide_bus and self.half < 0:
                self.half = 0
                return 0
            self.half = -1
            if is_data:
                self._move_on()
            return 0
        if not self.wide_bus and self.half >= 0:
            byte <<= 4
        for i in range(0 if self.wide_bus else 4, 8):
            self.chip.pins[self.data_pins[i]] = byte >> i & 1
        return 0

    # --- what a byte does ---------------------------------------------------------------------------------

    @cython.ccall
    def write(self, rs: cython.longlong, byte: cython.longlong) -> cython.int:
        """A whole byte: a character with `rs`, else an instruction."""
        if rs:
            self.characters += 1
            if not self.in_shapes:
                self.memory[self.address] = byte
                if self.follows:
                    self.shift += self.increment
            self._move_on()
        else:
            self.commands += 1
            self._instruct(byte)
        return 0

    @cython.cfunc
    def _instruct(self, byte: cython.longlong) -> cython.int:
        """Execute the instruction that the highest set bit selects."""
        i: cython.longlong
        step: cython.longlong
        if byte & SET_ADDRESS:
            self.in_shapes = False
            self.address = byte & 0x7F
        elif byte & SET_SHAPE_ADDRESS:
            self.in_shapes = True
            self.address = byte & 0x3F
        elif byte & FUNCTION_SET:
            self.wide_bus = (byte & 0x10) != 0
            self.two_lines = (byte & 0x08) != 0
            self.half = -1
        elif byte & SHIFT:
            step = 1 if byte & 0x04 else -1
            if byte & 0x08:
                self.shift -= step  # to the right: the glass begins a place earlier
            else:
                self.address = self._next_address(self.address, step)
        elif byte & DISPLAY_CONTROL:
            self.on = (byte & 0x04) != 0
        elif byte & ENTRY_MODE:
            self.increment = 1 if byte & 0x02 else -1
            self.follows = (byte & 0x01) != 0
        elif byte & (HOME | CLEAR):
            if not byte & HOME:
                for i in range(128):
                    self.memory[i] = SPACE
                self.increment = 1
            self.in_shapes = False
            self.address = 0
            self.shift = 0
        return 0

    @cython.cfunc
    def _move_on(self) -> cython.int:
        """The address behind one that was written or read."""
        if self.in_shapes:
            self.address = (self.address + self.increment) & 0x3F
        else:
            self.address = self._next_address(self.address, self.increment)
        return 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def _next_address(self, address: cython.longlong, step: cython.longlong) -> cython.longlong:
        """The next address: behind the end of a line comes the other one."""
        place: cython.longlong
        if not self.two_lines:
            return (address + step + ONE_LINE_LENGTH) % ONE_LINE_LENGTH
        place = address % SECOND_LINE + (LINE_LENGTH if address >= SECOND_LINE else 0)
        place = (place + step + 2 * LINE_LENGTH) % (2 * LINE_LENGTH)
        return place if place < LINE_LENGTH else SECOND_LINE + place - LINE_LENGTH

    @cython.ccall
    def shown(self, line: cython.longlong, place: cython.longlong) -> cython.longlong:
        """The code at a place of line 0 or 1 of the glass; 0 while it is off, or has no second line."""
        if not self.on or (line and not self.two_lines):
            return 0
        if not self.two_lines:
            return self.memory[((place + self.shift) % ONE_LINE_LENGTH + ONE_LINE_LENGTH) % ONE_LINE_LENGTH]
        place = ((place + self.shift) % LINE_LENGTH + LINE_LENGTH) % LINE_LENGTH
        return self.memory[SECOND_LINE * line + place]
