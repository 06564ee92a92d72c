"""Converters, timers, pins, serial ports: each against figures worked out by hand or given by the firmware."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.firmware_sim.analog import AnalogPins
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.adc_external import GAINS, Ads7871, register4
from ranger_sim.firmware_sim.peripherals.adc_internal import AdcInternal
from ranger_sim.firmware_sim.peripherals.gpio import Gpio, p0, p1
from ranger_sim.firmware_sim.peripherals.pwm import Pwm
from ranger_sim.firmware_sim.peripherals.spi_encoder import SpiEncoder
from ranger_sim.firmware_sim.peripherals.ssp import BIT_RATE, SEGMENT_WORDS, SspPort, SspSegment, segment_time_ns
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.peripherals.uart import Uart
from ranger_sim.firmware_sim.vic import ADC_DONE, EXTERNAL_INTERRUPT, FIQ, SPI_DONE, TIMER_MATCH, UART_TRANSMIT
from ranger_sim.foundation.events import (
    PIN_EDGE,
    PIN_OUTPUT,
    PWM_UPDATE,
    SSP_LOAD,
    SSP_SEGMENT,
    SSP_START,
    UART_BYTE,
    UART_OUTPUT,
)
from ranger_sim.foundation.user_error import UserError


def chip_at(now=0, **more):
    chip = Microcontroller("TEST", 60_000_000, **more)
    chip.advance(now)
    chip.now = now
    return chip


def sent(chip):
    """Everything in the outbox as (time, kind, a, b, c)."""
    box = chip.outbox
    messages = []
    while box.take():
        messages.append((box.time, box.kind, box.a, box.b, box.c))
    return messages


def served(chip, kind, index, slot=1):
    """Attach a handler to a source; the list of times at which it is served."""
    times = []
    chip.vic.attach(kind, index, lambda queue: times.append(chip.now), cost=0, slot=slot, latency=0)
    return times


# --- analog pins -------------------------------------------------------------------------------------------


def test_an_analog_pin_runs_straight_between_its_two_times_and_holds_outside():
    pins = AnalogPins()
    assert pins.volts(3, 77) == 0.0
    pins.set_pair(3, 1000, 1.0, 1400, 3.0)
    assert [pins.volts(3, time) for time in (0, 1000, 1100, 1200, 1400, 9999)] == [1.0, 1.0, 1.5, 2.0, 3.0, 3.0]


# --- GPIO --------------------------------------------------------------------------------------------------


def test_a_changed_output_is_reported_once_with_its_time():
    chip = chip_at(5_000)
    gpio = Gpio(chip)
    gpio.write(p0(11), 1)
    gpio.write(p0(11), 1)
    chip.now = 6_000
    gpio.toggle(p0(11))
    assert sent(chip) == [(5_000, PIN_OUTPUT, 11, 1, 0), (6_000, PIN_OUTPUT, 11, 0, 0)]


def test_the_first_write_is_reported_even_when_the_level_is_the_same():
    chip = chip_at()
    Gpio(chip).write(p1(17), 0)
    assert sent(chip) == [(0, PIN_OUTPUT, 49, 0, 0)]


def test_port_words_set_clear_and_show_pins():
    chip = chip_at()
    gpio = Gpio(chip)
    gpio.IOSET(1, 1 << 23 | 1 << 25)
    gpio.IOCLR(1, 1 << 25)
    assert gpio.IOPIN(1) == 1 << 23
    assert gpio.IOPIN(0) == 0
    assert [message[2:4] for message in sent(chip)] == [(55, 1), (57, 1), (57, 0)]


def test_an_edge_sets_its_pin_and_its_partner():
    chip = chip_at()
    gpio = Gpio(chip)
    chip.inbox.push(100, 0, PIN_EDGE, 22, 1, 27, 1)
    chip.inbox.push(200, 0, PIN_EDGE, 22, 0, -1, 0)
    chip.advance(150)
    assert (gpio.level(22), gpio.level(27)) == (1, 1)
    chip.advance(250)
    assert (gpio.level(22), gpio.level(27)) == (0, 1)


# --- timer capture -----------------------------------------------------------------------------------------


def edges(chip, pin, *moments):
    for time, level in moments:
        chip.inbox.push(time, 0, PIN_EDGE, pin, level, -1)


def test_a_capture_holds_the_count_of_its_edge_not_of_its_service():
    chip = chip_at()
    timer = TimerCapture(chip, period=30_000)
    timer.use_channel(0, 22)
    seen = []
    chip.vic.attach(
        PIN_EDGE, 22, lambda queue: seen.append((timer.CR0, timer.TC(), timer.IR)), cost=138, slot=FIQ, latency=12
    )
    edges(chip, 22, (100_000, 1))
    chip.advance(200_000)
    assert seen == [(6000, 6012, 16)]  # 200 ns of latency are 12 counts


def test_the_count_wraps_every_half_millisecond_by_the_boards_crystal():
    chip = chip_at(crystal=Crystal(10_000_000, 100_000))
    timer = TimerCapture(chip, period=30_000)
    assert timer.count_at(499_949) == 29_999
    assert timer.count_at(499_950) == 0
    # 100 ppm fast: after one true second 60,006,000 counts, which are 2000 wraps and 6000
    assert timer.count_at(1_000_000_000) == pytest.approx(6000, abs=1)
    assert timer.wraps == 2000


@given(st.integers(-50_000, 50_000), st.lists(st.integers(1, 10**12), min_size=1, max_size=8))
def test_the_count_is_right_however_far_the_time_jumps(ppb, jumps):
    chip = chip_at(crystal=Crystal(10_000_000, ppb))
    timer = TimerCapture(chip, period=30_000)
    time = 0
    for jump in jumps:
        time += jump
        exact = chip.crystal.ns_to_cycles(time, 60_000_000) % 30_000
        difference = (timer.count_at(time) - exact) % 30_000
        assert difference in (0, 1, 2, 29_999, 29_998)


def test_a_second_edge_before_the_first_is_read_overwrites_and_is_counted_as_lost():
    chip = chip_at()
    timer = TimerCapture(chip)
    timer.use_channel(2, 16)
    edges(chip, 16, (10_000, 1), (20_000, 0), (30_000, 1))
    chip.advance(25_000)
    assert (timer.CR2, timer.IR, list(timer.lost)) == (1200, 64, [0, 0, 1, 0])
    timer.clear(64)
    chip.advance(40_000)
    assert (timer.CR(2), timer.IR, list(timer.lost)) == (1800, 64, [0, 0, 1, 0])


def test_only_the_armed_edge_is_captured():
    chip = chip_at()
    timer = TimerCapture(chip)
    timer.use_channel(1, 27, rising=True, falling=False)
    assert timer.CCR == 0b101 << 3
    edges(chip, 27, (10_000, 0), (20_000, 1))
    chip.advance(15_000)
    assert (timer.CR1, timer.IR, timer.lost[1]) == (0, 0, 1)
    chip.advance(25_000)
    assert (timer.CR1, timer.IR, timer.lost[1]) == (1200, 32, 1)
    timer.arm(1, False, True)
    assert timer.CCR == 0b110 << 3


def test_the_match_interrupt_comes_at_every_wrap():
    chip = chip_at()
    TimerCapture(chip, number=1, period=12_000, match_interrupt=True)
    times = served(chip, TIMER_MATCH, 1, FIQ)
    chip.advance(1_000_000)
    assert times == [200_000, 400_000, 600_000, 800_000]


def test_an_edge_at_the_time_of_a_wrap_counts_zero_and_is_served_in_attaching_order():
    chip = chip_at()
    timer = TimerCapture(chip, match_interrupt=True)
    timer.use_channel(0, 22)
    order = []
    chip.vic.attach(PIN_EDGE, 22, lambda queue: order.append(("edge", timer.CR0)), cost=10, slot=FIQ)
    chip.vic.attach(TIMER_MATCH, 0, lambda queue: order.append("wrap"), cost=10, slot=FIQ)
    edges(chip, 22, (500_000, 1))
    chip.advance(510_000)
    assert order == [("edge", 0), "wrap"]
    assert (timer.wraps, timer.wrap_time) == (1, 500_000)


# --- PWM ---------------------------------------------------------------------------------------------------


def test_600_counts_at_60_megahertz_are_100_kilohertz_and_writes_wait_for_the_next_period():
    chip = chip_at(123_456)
    pwm = Pwm(chip, period=600)
    pwm.write(MR2=250, MR6=0)
    assert sent(chip) == [(130_000, PWM_UPDATE, 250, 0, 600)]
    chip.now = 130_000
    pwm.write(MR2=250, MR6=600)
    assert sent(chip) == [(130_000, PWM_UPDATE, 250, 600, 600)]


@pytest.mark.parametrize("ppb", [0, 31_415, -100_000_000])
@pytest.mark.parametrize("period", [599, 600, 120_000_000])
def test_periods_begin_at_ticks_of_the_crystal_whatever_the_pauses(ppb, period):
    chip = chip_at()
    chip.crystal = Crystal(ppb=ppb)
    pwm = Pwm(chip, period=period, phase_ns=123_456)
    period_ns = period * 1_000_000_000 // 60_000_000
    chip.now = 123_456
    for pause in (0, 1, 500_000, 9_999, 10_000, 1_999_999_999, 2_000_000_001, 7, 3_600_000_000_000, 12_345):
        chip.now += pause
        pwm.write(MR2=1, MR6=0)
        number = -(-chip.crystal.local_ns(chip.now - 123_456) // period_ns)
        assert pwm.period_start == chip.crystal.tick_time_ns(number, period_ns, 123_456)


@pytest.mark.parametrize("counts", [0, -1, 120_000_001])
def test_a_period_of_no_time_or_of_more_than_2_seconds_is_refused(counts):
    with pytest.raises(UserError, match=f"period {counts} counts"):
        Pwm(chip_at(), period=counts)


def test_match_values_drive_nothing_until_their_latch_is_enabled():
    chip = chip_at()
    pwm = Pwm(chip)
    pwm.MR2 = 100
    pwm.MR6 = 200
    pwm.latch(1 << 6)
    assert (pwm.latched_MR2, pwm.latched_MR6) == (0, 200)
    assert sent(chip) == [(0, PWM_UPDATE, 0, 200, 600)]
    pwm.MR5 = 30_000
    pwm.latch(1 << 5)
    assert pwm.latched_MR5 == 30_000
    assert sent(chip) == []  # a buzzer is no bridge


# --- external converter ------------------------------------------------------------------------------------


def test_the_start_word_holds_start_bit_gain_and_channel():
    assert register4(2, 1) == 0b1001_0010
    assert register4(15, 7) == 0xFF
    with pytest.raises(UserError, match="channel code 16"):
        register4(16, 0)
    with pytest.raises(UserError, match="gain code 8"):
        register4(0, 8)


@pytest.mark.parametrize(
    "volts, gain_code, counts",
    [
        (0.0, 0, 0),
        (1.25, 0, 4096),
        (-1.25, 0, -4096),
        (1.25, 1, 8191),  # twice: just beyond full scale
        (-1.3, 1, -8192),
        (0.01, 5, 328),  # 0.01 * 10 / 2.5 * 8192 = 327.68
        (2.5 / 8192 * 0.49, 0, 0),
        (2.5 / 8192 * 0.51, 0, 1),
        (-2.5 / 8192 * 0.51, 0, -1),
        (1e30, 7, 8191),
        (float("nan"), 0, 0),
    ],
)
def test_external_counts_are_14_bits_signed_of_the_reference(volts, gain_code, counts):
    assert Ads7871(chip_at()).convert(volts, gain_code) == counts


def test_scale_and_offset_of_a_board_enter_the_counts():
    assert Ads7871(chip_at(), scale=0.99, offset_counts=-9).convert(1.25, 0) == 4055 - 9


def test_a_conversion_lasts_a_48_thousandth_of_a_second_and_samples_at_its_start():
    chip = chip_at(1_000)
    adc = Ads7871(chip, eint=1)
    chip.analog.set_pair(4, 1_000, 1.0, 101_000, 2.0)
    adc.inputs = [0, 1, 4, *range(3, 16)]
    times = served(chip, EXTERNAL_INTERRUPT, 1)
    assert adc.start(register4(2, 0))
    assert not adc.start(register4(0, 0))  # busy
    chip.advance(100_000)
    assert times == [1_000 + 20_833]
    assert not adc.busy
    assert adc.read_result() == 3277  # 1 V of 2.5 V
    assert adc.registers[1] << 6 | adc.registers[0] >> 2 == 3277


def test_the_eight_gains_are_those_of_the_data_sheet():
    adc = Ads7871(chip_at())
    assert [adc.convert(0.01, code) for code in range(8)] == [round(0.01 * gain / 2.5 * 8192) for gain in GAINS]


def test_a_sequence_converts_one_channel_after_the_other_and_reports_its_end():
    chip = chip_at()
    adc = Ads7871(chip)
    adc.set_sequence((2, 1, 0), (1, 1, 1), (8, 0, 2))
    for pin, volts in enumerate((0.5, -0.25, 2.0)):
        chip.analog.set_pair(pin, 0, volts, 1, volts)
    chip.vic.attach(EXTERNAL_INTERRUPT, 1, adc.on_busy, cost=175, slot=1)
    assert adc.start_sequence()
    assert not adc.start_sequence()
    assert adc.not_finished == 1
    assert chip.advance(62_000) > 62_000
    assert not adc.sequence_done()
    chip.advance(70_000)
    # three conversions, and twice the interrupt's latency of 416 ns before the next one starts
    assert adc.sequence_done()
    assert list(adc.results[:3]) == [3277, -1638, 6554]
    assert adc.source.served == 3
    assert adc.start_sequence()


# --- internal converter ------------------------------------------------------------------------------------


def test_an_internal_conversion_at_300_kilohertz_takes_36_7_microseconds():
    chip = chip_at()
    adc = AdcInternal(chip, clkdiv=200)
    times = served(chip, ADC_DONE, 0)
    chip.analog.set_pair(1, 0, 1.65, 1, 1.65)
    assert adc.start(1)
    assert not adc.start(1)
    chip.advance(50_000)
    assert times == [36_666]
    assert (adc.result, adc.not_finished) == (512, 1)
    assert adc.GDR >> 6 & 1023 == 512
    assert adc.GDR >> 31 == 1


@pytest.mark.parametrize(
    "volts, counts", [(-1.0, 0), (0.0, 0), (3.3 / 1024, 1), (3.29, 1020), (3.3, 1023), (9.0, 1023)]
)
def test_internal_counts_are_10_bits(volts, counts):
    assert AdcInternal(chip_at()).convert(volts) == counts


def test_scale_and_offset_of_a_board_enter_the_internal_counts_too():
    adc = AdcInternal(chip_at(), scale=1.01, offset_counts=-5)
    assert adc.convert(1.65) == 517 - 5
    assert adc.convert(0.0) == 0
    assert adc.convert(float("nan")) == 0


def test_burst_mode_converts_two_channels_in_turn_at_15_kilohertz_each():
    chip = chip_at()
    adc = AdcInternal(chip, clkdiv=182)
    assert adc.conversion_ns == 33_366  # 11 clocks of 329.67 kHz
    adc.start_burst(0, 1)
    chip.analog.set_pair(0, 0, 0.0, 330_000, 3.3)
    chip.analog.set_pair(1, 0, 1.65, 1, 1.65)
    assert adc.DR(0) == 0
    chip.now = 33_366
    assert (adc.DR(0), adc.DR(1)) == (0, 0)
    chip.now = 66_732
    assert (adc.DR(0), adc.DR(1)) == (0, 512)
    chip.now = 100_098
    assert (adc.DR(0), adc.DR(1)) == (int(66_732 / 330_000 * 1024), 512)  # sampled when its conversion began
    assert adc.DR(5) == 0


# --- absolute encoder --------------------------------------------------------------------------------------


def test_the_encoder_word_is_13_bits_latched_at_the_start_and_there_after_14_microseconds():
    chip = chip_at(2_000)
    spi = SpiEncoder(chip, number=0, word=3)
    times = served(chip, SPI_DONE, 0, 10)
    chip.words[3] = 0x2000 + 4590
    assert spi.start()
    chip.words[3] = 1
    assert not spi.start()
    assert spi.SPSR == 0
    chip.advance(30_000)
    assert times == [16_000]
    assert spi.SPSR == 128
    assert spi.read() == 4590
    assert (spi.SPSR, spi.not_finished) == (0, 1)


# --- UART --------------------------------------------------------------------------------------------------


def test_divisor_6_and_5_fourteenths_give_460526_baud():
    uart = Uart(chip_at(), number=1, divisor=6, divaddval=5, mulval=14)
    assert round(uart.baud) == 460_526
    assert uart.byte_ns == 21_714
    assert 31 * uart.byte_ns == pytest.approx(0.67e6, rel=0.01)  # a packet of 31 bytes takes 0.67 ms


@pytest.mark.parametrize("fields", [(1, 0, 1), (1, 14, 15)])
def test_the_smallest_and_largest_dividers_are_possible(fields):
    uart = Uart(chip_at(), number=1)
    uart.set_divisor(*fields)
    assert (uart.DL, uart.DIVADDVAL, uart.MULVAL) == fields


@pytest.mark.parametrize("fields", [(0, 0, 1), (1, 0, 0), (1, -1, 1), (1, 15, 15), (1, 0, 16)])
def test_dividers_beyond_their_fields_are_refused(fields):
    with pytest.raises(UserError, match="is impossible"):
        Uart(chip_at(), number=1).set_divisor(*fields)


def test_the_receive_interrupt_comes_at_the_trigger_level_and_after_four_quiet_characters():
    chip = chip_at()
    uart = Uart(chip, number=1, divisor=6, divaddval=5, mulval=14, trigger=8)
    got = []

    def handler(queue):
        taken = []
        kind = uart.IIR
        while uart.LSR() & 1:
            taken.append(uart.RBR())
        got.append((chip.now, kind, taken))
        return len(taken)

    chip.vic.attach(UART_BYTE, 1, handler, cost=50, per_item=20, slot=3, latency=0)
    for byte in range(11):
        chip.inbox.push(100_000 + byte * 21_714, 0, UART_BYTE, 1, byte)
    chip.advance(1_000_000)
    assert got == [
        (100_000 + 7 * 21_714, 4, [0, 1, 2, 3, 4, 5, 6, 7]),
        (100_000 + 14 * 21_714, 12, [8, 9, 10]),
    ]


def test_bytes_that_a_handler_leaves_ask_again_after_four_characters():
    chip = chip_at()
    uart = Uart(chip, number=0, trigger=4)
    times = []

    def handler(queue):
        times.append((chip.now, uart.IIR))
        uart.RBR()

    chip.vic.attach(UART_BYTE, 0, handler, cost=50, slot=3, latency=0)
    chip.inbox.push(50_000, 0, UART_BYTE, 0, 0, 4, 0, 0)
    chip.advance(10_000_000)
    quiet = 4 * uart.byte_ns
    assert times == [(50_000, 4), *((50_000 + n * quiet, 12) for n in (1, 2, 3))]
    assert uart.waiting() == 0


def test_a_full_receive_fifo_loses_the_new_byte_and_reports_it_once():
    chip = chip_at()
    uart = Uart(chip, number=0)
    for byte in range(18):
        chip.inbox.push(1000 * byte, 0, UART_BYTE, 0, byte)
    chip.advance(1_000_000)
    assert (uart.received, uart.overruns, uart.waiting()) == (18, 2, 16)
    assert uart.LSR() & 3 == 3
    assert uart.LSR() & 3 == 1
    assert [uart.RBR() for _ in range(17)] == [*range(16), 0]


def test_bytes_that_arrived_as_a_group_are_taken_in_their_order():
    chip = chip_at()
    uart = Uart(chip, number=0, trigger=8)
    times = served(chip, UART_BYTE, 0)
    word_0, word_1 = int.from_bytes(b"ABCD", "little"), int.from_bytes(b"EFGH", "little")
    chip.inbox.push(50_000, 0, UART_BYTE, 0, 0, 8, word_0, word_1)
    chip.advance(60_000)
    assert times == [50_000]
    assert bytes(uart.RBR() for _ in range(8)) == b"ABCDEFGH"
    chip.inbox.push(70_000, 0, UART_BYTE, 0, 0, 3, word_0, word_1)
    chip.advance(80_000)
    assert bytes(uart.RBR() for _ in range(uart.waiting())) == b"ABC"


def test_bytes_leave_one_after_the_other_and_the_empty_fifo_asks_for_more():
    chip = chip_at(1_000)
    uart = Uart(chip, number=0, divisor=30)  # 125 kbaud: 80 us per byte
    times = served(chip, UART_TRANSMIT, 0, 9)
    assert uart.LSR() == 96
    assert uart.THR(0x41)
    assert uart.LSR() == 32
    assert uart.THR(0x142)
    assert uart.LSR() == 0
    assert sent(chip) == [(81_000, UART_OUTPUT, 0, 0x41, 0), (161_000, UART_OUTPUT, 0, 0x42, 0)]
    chip.advance(200_000)
    assert times == [81_000]
    chip.now = 161_000
    assert uart.LSR() == 96


def test_a_full_transmit_fifo_refuses():
    chip = chip_at()
    uart = Uart(chip)
    accepted = [uart.THR(byte) for byte in range(20)]
    assert accepted == [True] * 17 + [False] * 3  # one in the shift register, 16 behind it
    assert uart.refused == 3


# --- SSP ---------------------------------------------------------------------------------------------------


def test_a_segment_of_31_half_words_at_3_megabit_takes_165_3_microseconds():
    assert segment_time_ns(SEGMENT_WORDS, 16, BIT_RATE) == 165_333


def test_master_and_slave_put_their_segments_on_the_wire():
    chip = chip_at(7_000)
    port = SspPort(chip)
    segment = SspSegment()
    segment.words = [0] * 30 + [1]
    segment.used = 31
    port.start(segment)
    port.load(segment)
    assert chip.outbox.take()
    out = chip.outbox
    assert (out.time, out.kind, out.ref) == (7_000, SSP_START, segment)
    assert [out.order, out.a, out.b, out.c, out.d, out.e, out.f] == [0] * 7  # port 0, and nothing else is said
    assert chip.outbox.take()
    assert (out.time, out.kind, out.ref) == (7_000, SSP_LOAD, segment)
    assert [out.order, out.a, out.b, out.c, out.d, out.e, out.f] == [0] * 7
    segment.words = list(range(500, 531))
    copy = SspSegment()
    copy.copy_from(segment)
    segment.clear()
    assert (list(copy.words), copy.used) == (list(range(500, 531)), 31)
    assert (list(segment.words), segment.used) == ([0] * 30 + [1], 0)


def test_a_segment_shows_the_half_words_that_were_put_into_it_and_how_wrong_their_checksum_is():
    segment = SspSegment()
    segment.words = list(range(100, 131))
    assert list(segment.rows[:4]) == [100, 101 << 16 | 102, 103 << 16 | 104, 105]
    right = 1 + sum(range(100, 130))
    assert segment.checksum_error == (130 - right) % 65536
    assert segment.words == list(range(100, 131))
    segment.checksum_error = 0
    assert segment.words[30] == right


def test_a_segment_that_is_loaded_already_goes_out_again_without_a_word():
    chip = chip_at()
    port = SspPort(chip)
    first, second = SspSegment(), SspSegment()
    reported = []
    for segment in (first, first, second, second, first):
        port.load(segment)
        while chip.outbox.take():
            reported.append(chip.outbox.ref)
    assert reported == [first, second, first]


def test_a_segment_that_comes_in_interrupts_and_is_taken_once():
    chip = chip_at()
    port = SspPort(chip)
    times = served(chip, SSP_SEGMENT, 0, FIQ)
    first, second = SspSegment(), SspSegment()
    chip.inbox.push(165_333, 0, SSP_SEGMENT, 0, ref=first)
    chip.advance(200_000)
    assert times == [165_333]
    assert port.take() is first
    assert port.take() is None
    chip.inbox.push(300_000, 0, SSP_SEGMENT, 0, ref=first)
    chip.inbox.push(400_000, 0, SSP_SEGMENT, 0, ref=second)
    chip.advance(500_000)
    assert (port.exchanges, port.overwritten, port.received_time) == (3, 1, 400_000)
    assert port.take() is second


# --- misuse ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "make, reported",
    [
        (lambda chip: TimerCapture(chip, period=0), "period 0"),
        (lambda chip: TimerCapture(chip, period=7), "not a whole number of ns"),
        (lambda chip: TimerCapture(chip).use_channel(4, 22), "channel 4"),
        (lambda chip: TimerCapture(chip).use_channel(0, 64), "pin 64"),
        (lambda chip: [TimerCapture(chip).use_channel(0, 22) for _ in range(2)], "pin 22 is claimed twice"),
        (lambda chip: Pwm(chip, period=0), "period 0"),
        (lambda chip: Ads7871(chip, reference_V=0.0), "reference_V 0.0"),
        (lambda chip: Ads7871(chip).set_sequence(), "0 sequence entries"),
        (lambda chip: AdcInternal(chip, clkdiv=0), "clkdiv 0"),
        (lambda chip: AdcInternal(chip).start_burst(8), "burst channels"),
        (lambda chip: SpiEncoder(chip, bits=17), "17 bits"),
        (lambda chip: Uart(chip, trigger=3), "trigger level 3"),
        (lambda chip: Uart(chip, divisor=0), "divisor 0"),
        (lambda chip: [Uart(chip, number=1) for _ in range(2)], "claimed twice"),
        (lambda chip: [SpiEncoder(chip) for _ in range(17)], "more than 16 peripheral alarms"),
        (lambda chip: Microcontroller("X", hz=0), "hz 0"),
    ],
)
def test_an_impossible_peripheral_is_refused_with_its_value(make, reported):
    with pytest.raises(UserError, match=reported):
        make(chip_at())
