"""Each block by its registers, with known answers: the LPC2194 user manual's words, in numbers worked out by hand.

The processor is in a loop at the crystal's 10 MHz, and so do the peripherals: a count lasts 100 ns.
"""

import pytest

from ranger_sim.firmware_sim.lpc2194.address_map import NotModelledAccess
from ranger_sim.firmware_sim.lpc2194.hardware import BoardHardware
from ranger_sim.firmware_sim.native.hardware import ExternalConverter
from ranger_sim.foundation.events import CAN_MODE, CAN_REQUEST, CAN_RX, PIN_EDGE, PIN_OUTPUT, PWM_UPDATE, UART_BYTE
from ranger_sim.foundation.events import UART_OUTPUT as BYTE_OUT
from tests.firmware_sim.lpc2194.programs import board_with

COUNT_NS = 100
T0, T1, UART1, PWM, SPI0 = 0xE0004000, 0xE0008000, 0xE0010000, 0xE0014000, 0xE0020000
PINSEL, ADC, FILTER, CAN1, SSP = 0xE002C000, 0xE0034000, 0xE003C000, 0xE0044000, 0xE005C000
SYSTEM, GPIO, VIC = 0xE01FC000, 0x3FFFC000, 0xFFFFF000
IRQ, FIQ = 1, 2


class Chip:
    """A chip whose registers the test reads and writes."""

    def __init__(self, **hardware):
        self.board = board_with([0xEAFFFFFE], BoardHardware(**hardware))  # b .
        self.write(SYSTEM + 0x100, 1)  # VPBDIV: the peripherals' clock is the processor's

    def at(self, us):
        """Pass time to this time."""
        self.board.advance(round(us * 1000))
        self.board.catch_up()
        self.board.core.began = round(us * 1000) // COUNT_NS
        return self

    def write(self, address, value, size=4):
        self.board.map.write(address, size, value)

    def read(self, address, size=4):
        return self.board.map.read(address, size)

    def lines(self):
        """What the processor sees."""
        return self.board.vic_block.lines

    def out(self, kind):
        queue, found = self.board.outbox, []
        while queue.take():
            if queue.kind == kind:
                found.append((queue.time, queue.a, queue.b, queue.c, queue.d, queue.e & 0xFFFFFFFF))
        return found


# --- timers ---------------------------------------------------------------------------------------------------


def test_a_timer_counts_to_its_match_asks_for_the_interrupt_and_begins_anew():
    chip = Chip()
    chip.write(T1 + 0x18, 999)  # MR0
    chip.write(T1 + 0x14, 3)  # interrupt and reset
    chip.write(T1 + 0x04, 1)
    assert chip.at(99.9).read(T1 + 0x08) == 999
    assert chip.read(T1) == 0
    assert chip.at(100.1).read(T1 + 0x08) == 1
    assert chip.read(T1) == 1
    chip.write(T1, 1)
    assert chip.read(T1) == 0
    assert chip.at(250.0).read(T1 + 0x08) == 500
    assert chip.read(T1) == 1


def test_a_second_match_acts_in_every_period_and_a_stop_lasts():
    chip = Chip()
    for register, value in ((0x18, 999), (0x1C, 499), (0x14, 2 | 1 << 3), (0x04, 1)):
        chip.write(T0 + register, value)
    assert chip.at(49.9).read(T0) == 0
    assert chip.at(50.1).read(T0) == 2
    chip.write(T0, 2)
    assert chip.at(149.9).read(T0) == 0
    assert chip.at(150.1).read(T0) == 2
    chip.write(T0 + 0x14, 4 | 1)  # stop at MR0, with its interrupt
    assert chip.at(300.0).read(T0 + 0x04) == 0
    assert chip.read(T0 + 0x08) == 999
    assert chip.read(T0) == 3


def test_prescaler_writes_of_the_count_and_reset():
    chip = Chip()
    chip.write(T0 + 0x0C, 9)  # a count lasts 1 us
    chip.write(T0 + 0x04, 1)
    assert chip.at(123.4).read(T0 + 0x08) == 123
    assert chip.read(T0 + 0x10) == 4  # PC
    chip.write(T0 + 0x08, 1000)
    assert chip.at(133.4).read(T0 + 0x08) == 1010
    chip.write(T0 + 0x04, 2)
    assert chip.at(150.0).read(T0 + 0x08) == 0
    chip.write(T0 + 0x04, 0)
    assert chip.at(160.0).read(T0 + 0x08) == 0


def test_an_edge_is_captured_at_the_pin_that_pinsel_connects_in_the_direction_that_is_armed():
    chip = Chip()
    chip.write(T0 + 0x04, 1)
    chip.write(T0 + 0x28, 5)  # CCR: rising edges of capture 0, with interrupt
    for us, level in ((10.0, 1), (20.0, 0)):
        chip.board.inbox.push(round(us * 1000), 256, PIN_EDGE, 22, level, -1, 0)
    assert chip.at(30.0).read(T0) == 0  # P0.22 is a GPIO
    chip.write(PINSEL + 4, 2 << 12)  # P0.22 is CAP0.0
    for us, level in ((42.0, 1), (50.0, 0)):
        chip.board.inbox.push(round(us * 1000), 256, PIN_EDGE, 22, level, -1, 0)
    assert chip.at(60.0).read(T0) == 0x10
    assert chip.read(T0 + 0x2C) == 420


# --- interrupts -----------------------------------------------------------------------------------------------


def test_the_first_slot_is_served_first_and_the_later_ones_wait_for_its_end():
    chip = Chip()
    for slot, number in ((2, 6), (5, 4)):
        chip.write(VIC + 0x100 + 4 * slot, 0x1000 + slot)
        chip.write(VIC + 0x200 + 4 * slot, 0x20 | number)
    chip.write(VIC + 0x34, 0x9999)
    chip.write(VIC + 0x10, 1 << 4 | 1 << 6 | 1 << 9)
    chip.write(VIC + 0x18, 1 << 4)
    assert chip.lines() == IRQ
    assert chip.read(VIC + 0x30) == 0x1005
    assert chip.lines() == 0  # it is being served
    chip.write(VIC + 0x18, 1 << 6)
    assert chip.lines() == IRQ  # before it
    assert chip.read(VIC + 0x30) == 0x1002
    chip.write(VIC + 0x1C, 1 << 6)
    chip.write(VIC + 0x30, 0)
    assert chip.lines() == 0  # back in slot 5, which still asks
    chip.write(VIC + 0x30, 0)
    assert chip.lines() == IRQ
    chip.write(VIC + 0x1C, 1 << 4)
    assert chip.lines() == 0
    chip.write(VIC + 0x18, 1 << 9)  # an input without a slot
    assert chip.read(VIC + 0x30) == 0x9999


def test_an_input_is_fast_when_it_is_selected_and_silent_when_it_is_not_enabled():
    chip = Chip()
    chip.write(VIC + 0x18, 1 << 5)
    assert (chip.lines(), chip.read(VIC + 0x08)) == (0, 1 << 5)
    chip.write(VIC + 0x0C, 1 << 5)
    chip.write(VIC + 0x10, 1 << 5)
    assert chip.lines() == FIQ
    assert (chip.read(VIC + 0x04), chip.read(VIC + 0x00)) == (1 << 5, 0)
    chip.write(VIC + 0x14, 1 << 5)
    assert chip.lines() == 0


# --- serial ports ---------------------------------------------------------------------------------------------


def test_a_byte_leaves_at_the_rate_of_the_divisor_latch():
    chip = Chip()
    chip.write(UART1 + 0x0C, 0x83)
    chip.write(UART1, 65)  # 16 x 65 clocks a bit: 104 us, ten of them a byte
    chip.write(UART1 + 0x0C, 0x03)
    chip.write(UART1, 0x5A, size=1)
    assert chip.read(UART1 + 0x14) == 0x20  # one byte goes out, none waits
    assert chip.out(BYTE_OUT) == [(1_040_000, 1, 0x5A, 0, 0, 0)]
    assert chip.at(1_040.1).read(UART1 + 0x14) == 0x60


def test_received_bytes_ask_at_the_trigger_level_and_after_four_characters_of_silence():
    chip = Chip()
    chip.write(UART1 + 0x0C, 0x83)
    chip.write(UART1, 1)  # a byte takes 16 us
    chip.write(UART1 + 0x0C, 0x03)
    chip.write(UART1 + 0x08, 0x41)  # trigger level 4
    chip.write(UART1 + 0x04, 1)
    chip.write(VIC + 0x10, 1 << 7)
    for us, byte in ((20, 1), (40, 2), (60, 3), (80, 4)):
        chip.board.inbox.push(us * 1000, 512, UART_BYTE, 1, byte)
    assert chip.at(79).lines() == 0
    assert chip.at(81).lines() == IRQ
    assert chip.read(UART1 + 0x08) & 15 == 4
    assert chip.read(UART1) == 1
    assert chip.lines() == 0  # three are below the level
    assert chip.at(81 + 63).lines() == 0
    assert chip.at(81 + 65).lines() == IRQ
    assert chip.read(UART1 + 0x08) & 15 == 12
    assert [chip.read(UART1) for _ in range(3)] == [2, 3, 4]
    assert chip.read(UART1 + 0x08) & 15 == 1


def test_words_of_the_ssp_follow_each_other_and_its_flags_count_them():
    chip = Chip(external=None)
    chip.write(SSP + 0x00, 0x00CF)  # 16 bits
    chip.write(SSP + 0x10, 2)  # a bit is two clocks: a word takes 3.2 us
    chip.write(SSP + 0x04, 2)
    for word in range(9):
        chip.write(SSP + 0x08, word)
    assert chip.read(SSP + 0x0C) == 16  # busy, and no room: one is on its way, eight wait
    assert chip.read(SSP + 0x18) == 0
    assert chip.at(3.3).read(SSP + 0x0C) == 16 + 4 + 2
    assert chip.at(13.0).read(SSP + 0x18) == 8 + 4  # four came, four wait
    assert chip.at(9 * 3.2 + 0.1).read(SSP + 0x18) == 8 + 4 + 1  # the ninth found no room
    chip.write(SSP + 0x20, 1)
    assert chip.read(SSP + 0x18) == 8 + 4
    assert chip.at(9 * 3.2 + 6.5).read(SSP + 0x18) == 8 + 4 + 2  # nobody read for 32 bits
    for _ in range(8):
        chip.read(SSP + 0x08)
    assert chip.read(SSP + 0x18) == 8
    assert chip.read(SSP + 0x0C) == 1 + 2


def test_the_external_converter_is_started_and_read_word_by_word_and_its_busy_line_interrupts():
    chip = Chip(external=ExternalConverter(eint=1, conversion_ns=31_000, inputs={9: 3}))
    chip.board.analog.set_pair(3, 0, 1.25, 1, 1.25)  # half of full scale: 4,096 of 8,192
    for register, value in ((0x00, 0x00CF), (0x10, 2), (0x04, 2)):
        chip.write(SSP + register, value)
    chip.write(SYSTEM + 0x148, 2)  # EINT1 at falling edges
    chip.write(VIC + 0x10, 1 << 15)
    chip.write(SSP + 0x08, 0x0489)  # register 4: start, gain 1, channel 9
    assert chip.at(34.1).read(SYSTEM + 0x140) == 0
    assert chip.at(34.3).read(SYSTEM + 0x140) == 2  # 3.2 us for the word, 31 us for the conversion
    assert chip.lines() == IRQ
    chip.write(SYSTEM + 0x140, 2)
    assert chip.lines() == 0
    chip.read(SSP + 0x08)
    chip.write(SSP + 0x08, 0x4100)
    chip.write(SSP + 0x08, 0x4000)
    chip.at(41.0)
    assert (chip.read(SSP + 0x08), chip.read(SSP + 0x08)) == (4096 >> 6, (4096 << 2) & 0xFC)


def test_the_absolute_encoders_word_is_there_after_its_bits():
    chip = Chip()
    chip.board.words[0] = 5000
    chip.write(SPI0 + 0x0C, 10)  # 1 us a bit
    chip.write(SPI0, 0x80 | 0x20 | 14 << 8 | 4)  # 14 bits, master, interrupt
    chip.write(VIC + 0x10, 1 << 10)
    chip.write(SPI0 + 0x08, 0)
    assert (chip.at(13.9).lines(), chip.read(SPI0 + 0x04)) == (0, 0)
    assert (chip.at(14.1).lines(), chip.read(SPI0 + 0x04)) == (IRQ, 0x80)
    assert chip.read(SPI0 + 0x08) == 5000
    assert chip.read(SPI0 + 0x04) == 0
    chip.write(SPI0 + 0x1C, 1)
    assert chip.lines() == 0


# --- converter, PWM, pins, CAN, clocks ------------------------------------------------------------------------


def test_the_internal_converter_converts_once_or_in_turn():
    chip = Chip()
    chip.board.analog.set_pair(1, 0, 1.65, 1, 1.65)
    chip.board.analog.set_pair(0, 0, 0.825, 1, 0.825)
    chip.write(VIC + 0x10, 1 << 18)
    chip.write(ADC, 1 << 24 | 1 << 21 | 1 << 8 | 2)  # start channel 1, two clocks each: 11 x 0.2 us
    assert (chip.at(2.1).read(ADC + 0x04) >> 31, chip.lines()) == (0, 0)
    assert chip.at(2.3).lines() == IRQ
    assert chip.read(ADC + 0x04) == 1 << 31 | 1 << 24 | 512 << 6
    assert chip.lines() == 0
    assert chip.read(ADC + 0x04) >> 31 == 0  # it was read
    chip.write(ADC, 1 << 16 | 1 << 21 | 1 << 8 | 3)  # burst over 0 and 1
    assert chip.at(10.0).read(ADC + 0x10) == 1 << 31 | 256 << 6
    assert chip.read(ADC + 0x14) == 1 << 31 | 512 << 6
    assert chip.read(ADC + 0x14) == 512 << 6


def test_duties_are_latched_at_the_next_period():
    chip = Chip()
    for register, value in ((0x18, 1000), (0x20, 0), (0x14, 2), (0x04, 9)):  # 100 us periods from 0 on
        chip.write(PWM + register, value)
    assert chip.out(PWM_UPDATE) == [(0, 0, 0, 1000, 0, 0)]
    chip.at(150.0).write(PWM + 0x20, 250)  # MR2
    assert chip.out(PWM_UPDATE) == []
    chip.write(PWM + 0x50, 4)  # LER
    assert chip.out(PWM_UPDATE) == [(200_000, 250, 0, 1000, 0, 0)]


def test_pins_show_their_latch_when_they_are_outputs_and_masks_hide_them():
    chip = Chip(pulled_up=(3,))
    chip.write(GPIO + 0x18, 0x400)  # an input's latch
    assert chip.out(PIN_OUTPUT) == []
    chip.write(GPIO + 0x00, 0x400)
    assert [row[1:3] for row in chip.out(PIN_OUTPUT)] == [(10, 1)]
    assert chip.read(GPIO + 0x14) == 0x408
    chip.write(GPIO + 0x1D, 0x04, size=1)  # FIO0CLR1: pins 8 to 15
    assert [row[1:3] for row in chip.out(PIN_OUTPUT)] == [(10, 0)]
    chip.write(GPIO + 0x10, 0x400)
    chip.write(GPIO + 0x18, 0xFFFFFFFF)
    assert chip.out(PIN_OUTPUT) == []
    assert chip.read(0xE0028000) == 8  # IO0PIN knows no mask


def test_a_can_controller_is_silent_until_it_leaves_reset_and_marks_frames_received_in_bypass():
    chip = Chip()
    chip.board.inbox.push(5_000, 512, CAN_RX, 1, 77, 8, 1, 2)
    assert chip.at(10.0).read(CAN1 + 0x1C) & 1 == 0
    chip.write(CAN1 + 0x14, 0x00254001)
    chip.write(CAN1 + 0x10, 1)
    chip.write(FILTER, 2)
    chip.write(CAN1, 0)
    assert [row[1:3] for row in chip.out(CAN_MODE)] == [(1, 0)]
    chip.write(VIC + 0x10, 1 << 26)
    chip.board.inbox.push(20_000, 512, CAN_RX, 1, 77, 8, 1, 2)
    assert chip.at(30.0).lines() == IRQ
    assert (chip.read(CAN1 + 0x20), chip.read(CAN1 + 0x24)) == (0x80400, 77)
    chip.write(CAN1 + 0x04, 4)  # RRB
    assert chip.lines() == 0
    for register, value in ((0x40, 0x80000), (0x44, 33), (0x48, 5), (0x4C, 6), (0x04, 0x41)):  # buffer 2
        chip.write(CAN1 + register, value)
    assert chip.out(CAN_REQUEST) == [(30_000, 1, 2, 33, 8, 5)]
    assert chip.read(CAN1 + 0x1C) & 0x0C00 == 0  # on its way


def test_the_pll_takes_over_when_it_was_fed_locked_and_fed_again():
    chip = Chip()
    chip.write(SYSTEM + 0x84, 0x25)
    chip.write(SYSTEM + 0x80, 1)
    assert chip.read(SYSTEM + 0x88) == 0
    for byte in (0xAA, 0x55):
        chip.write(SYSTEM + 0x8C, byte)
    assert chip.read(SYSTEM + 0x88) == 0x125
    assert chip.at(200.0).read(SYSTEM + 0x88) == 0x525  # locked
    chip.write(SYSTEM + 0x80, 3)
    for byte in (0xAA, 0x00, 0x55):
        chip.write(SYSTEM + 0x8C, byte)
    assert chip.board.clocks.cclk == 10_000_000  # the sequence was broken
    for byte in (0xAA, 0x55):
        chip.write(SYSTEM + 0x8C, byte)
    assert chip.board.clocks.cclk == 60_000_000


@pytest.mark.parametrize(
    ("address", "value", "why"),
    [
        (T0 + 0x70, 1, "timer 0: CTCR) as a word at pc 0x00000000: counting edges at a pin (CTCR) is not modelled"),
        (FILTER, 4, "CAN acceptance filter: AFMR"),
        (CAN1 + 0x04, 0x10, "CAN1: CMR"),
        (SYSTEM + 0x40, 2, "MEMMAP 2: vectors elsewhere than in flash is not modelled"),
        (SPI0 + 0x100, 0, "no register is modelled there"),
        (0xE0024000, 0, "no device is modelled there"),
    ],
)
def test_an_access_that_is_not_modelled_is_reported_with_register_and_place(address, value, why):
    chip = Chip()
    with pytest.raises(NotModelledAccess) as caught:
        chip.write(address, value)
    assert why in str(caught.value)
    assert (caught.value.address, caught.value.pc) == (address, 0)
