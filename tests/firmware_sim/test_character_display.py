"""The character display at its pins, by instructions of the HD44780U's data sheet."""

import pytest

from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.character_display import CharacterDisplay

DATA, RS, RW, ENABLE = range(8), 15, 10, 11
TWO_LINES, ONE_LINE, HALVES = 0x38, 0x30, 0x28
ON, OFF, RIGHTWARDS, CLEAR, HOME = 0x0C, 0x08, 0x06, 0x01, 0x02


class Wired:
    """A display whose pins a test moves, as a program does."""

    def __init__(self):
        self.chip = Microcontroller("chip")
        self.display = CharacterDisplay(self.chip, DATA, RS, RW, ENABLE)

    def strobe(self, levels, pins):
        """One pulse of E with these levels at data pins; True when a byte was taken."""
        self.chip.pins[RW] = 0
        for bit, pin in enumerate(pins):
            self.chip.pins[pin] = levels >> bit & 1
        assert not self.display.on_enable(1)
        return self.display.on_enable(0)

    def send(self, rs, *bytes_):
        self.chip.pins[RS] = rs
        return [self.strobe(byte, DATA) for byte in bytes_]

    def send_halves(self, rs, *bytes_):
        self.chip.pins[RS] = rs
        return [self.strobe(half, range(4, 8)) for byte in bytes_ for half in (byte >> 4, byte & 15)]

    def read(self, rs):
        """A read over eight lines; the pins show it while E is high."""
        self.chip.pins[RS], self.chip.pins[RW] = rs, 1
        assert not self.display.on_enable(1)
        byte = sum(self.chip.pins[pin] << pin for pin in DATA)
        assert not self.display.on_enable(0)
        return byte

    def lines(self, places=8):
        codes = [[self.display.shown(line, place) for place in range(places)] for line in (0, 1)]
        return tuple("".join(map(chr, line)) for line in codes)


@pytest.fixture
def wired():
    return Wired()


@pytest.fixture
def started(wired):
    wired.send(0, TWO_LINES, ON, RIGHTWARDS, CLEAR)
    return wired


def test_a_byte_is_taken_at_the_falling_edge_of_e(wired):
    assert wired.send(0, TWO_LINES, ON) == [True, True]
    wired.chip.pins[RS] = 1
    wired.chip.pins[0] = wired.chip.pins[6] = 1  # 0x41, with 0x0C's bits 2 and 3 still there
    wired.display.on_enable(1)
    assert wired.lines()[0] == " " * 8
    wired.chip.pins[2] = wired.chip.pins[3] = 0
    assert wired.display.on_enable(0) and wired.lines()[0] == "A" + " " * 7
    assert not wired.display.on_enable(0)  # no edge
    assert wired.lines()[0] == "A" + " " * 7


def test_after_power_up_it_is_off_and_has_one_line(wired):
    wired.send(1, *b"dark")
    assert wired.lines() == ("\0" * 8, "\0" * 8)
    wired.send(0, ON)
    assert wired.lines() == ("dark    ", "\0" * 8)  # no second line before it is asked for
    wired.send(0, OFF)
    assert wired.lines()[0] == "\0" * 8


def test_the_second_line_begins_at_0x40(started):
    started.send(1, *b"Ranger")
    started.send(0, 0x80 | 0x40)
    started.send(1, *b"walks")
    assert started.lines() == ("Ranger  ", "walks   ")
    started.send(0, 0x80 | 0x42)
    started.send(1, ord("i"))
    assert started.lines()[1] == "waiks   "


def test_behind_the_fortieth_place_comes_the_other_line(started):
    started.send(0, 0x80 | 0x27)
    started.send(1, *b"XY")
    assert started.display.memory[0x27] == ord("X") and started.lines()[1][0] == "Y"
    started.send(0, 0x80 | 0x67)
    started.send(1, *b"XY")
    assert started.display.memory[0x67] == ord("X") and started.lines()[0][0] == "Y"


def test_with_one_line_eighty_places_follow_each_other(wired):
    wired.send(0, ONE_LINE, ON, CLEAR, 0x80 | 79)
    wired.send(1, *b"XY")
    assert wired.display.memory[79] == ord("X") and wired.lines()[0][0] == "Y"


def test_clearing_leaves_spaces_and_goes_home_and_home_leaves_what_is_there(started):
    started.send(1, *b"abc")
    started.send(0, HOME)
    assert started.lines()[0] == "abc     "
    started.send(1, ord("x"))
    assert started.lines()[0] == "xbc     "
    started.send(0, CLEAR)
    assert started.lines() == (" " * 8, " " * 8)
    started.send(1, ord("y"))
    assert started.lines()[0] == "y       "


def test_the_cursor_can_move_leftwards_and_clearing_ends_that(started):
    started.send(0, 0x04, 0x80 | 3)
    started.send(1, *b"dcba")
    assert started.lines()[0] == "abcd    "
    started.send(0, CLEAR)
    started.send(1, *b"ok")
    assert started.lines()[0] == "ok      "


def test_the_cursor_moves_by_a_place_either_way(started):
    started.send(1, *b"aXcX")
    started.send(0, 0x10, 0x10, 0x10)  # three to the left
    started.send(1, ord("b"))
    started.send(0, 0x14)  # one to the right
    started.send(1, ord("d"))
    assert started.lines()[0] == "abcd    "


@pytest.mark.parametrize(
    ("shifts", "line"),
    [([0x18], "bcdefghi"), ([0x18, 0x18, 0x1C], "bcdefghi"), ([0x1C], " abcdefg"), ([0x18] * 40, "abcdefgh")],
)
def test_the_glass_is_a_window_on_forty_places(started, shifts, line):
    started.send(1, *b"abcdefghi")
    started.send(0, *shifts)
    assert started.lines()[0] == line
    started.send(0, HOME)
    assert started.lines()[0] == "abcdefgh"


def test_writing_can_shift_the_glass(started):
    started.send(0, 0x80 | 8, 0x07)
    started.send(1, *b"AB")
    assert started.lines()[0] == " " * 6 + "AB"
    started.send(0, 0x05, 0x80)  # leftwards: the other way
    started.send(1, ord("C"))
    assert started.lines()[0] == " " * 7 + "A"


def test_own_shapes_do_not_write_over_characters(started):
    started.send(1, *b"abc")
    started.send(0, 0x40 | 8)
    started.send(1, *[0x1F] * 8)
    assert started.lines()[0] == "abc     "
    started.send(0, 0x80 | 1)
    started.send(1, 1)
    assert started.lines()[0] == "a\x01c     "


def test_over_four_lines_a_byte_comes_in_two_halves(wired):
    assert wired.send(0, HALVES) == [True]  # the last one over eight
    assert wired.send_halves(0, HALVES, ON, CLEAR) == [False, True] * 3
    wired.send_halves(1, *b"half")
    wired.send_halves(0, 0x80 | 0x40)
    wired.send_halves(1, *b"whole")
    assert wired.lines() == ("half    ", "whole   ")


def test_characters_can_be_read_back_and_the_display_is_never_busy(started):
    started.send(1, *b"read")
    started.send(0, 0x80 | 1)
    assert started.read(rs=0) == 1
    assert [started.read(rs=1) for _ in range(3)] == list(b"ead")
    assert started.read(rs=0) == 4
    started.send(1, ord("y"))
    assert started.lines()[0] == "ready   "
