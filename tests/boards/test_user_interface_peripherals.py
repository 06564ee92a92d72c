"""Display, lights, buzzer, keys, radio control and sync light, each on its own."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.boards.modules.buzzer import PERIOD_AT_START, TUNE, Buzzer, BuzzerFrequency, ErrorSound, TuneStart
from ranger_sim.boards.modules.colour_leds import ColourLeds, LedReceiver
from ranger_sim.boards.modules.front_panel import KEY_PINS, SYNC, FrontPanel
from ranger_sim.boards.modules.keypad import Keypad
from ranger_sim.boards.modules.lcd import Lcd, LcdQuarter
from ranger_sim.boards.modules.rc_receiver import RcReceiver
from ranger_sim.boards.modules.sync_light import SyncLight
from ranger_sim.datatable.generated import errors
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
from ranger_sim.firmware_sim.peripherals.led_drivers import REGISTERS
from ranger_sim.firmware_sim.peripherals.pwm import Pwm
from ranger_sim.firmware_sim.peripherals.ssp import SspMaster


def word(text):
    return sum(ord(c) << (8 * i) for i, c in enumerate(text))


@pytest.fixture
def said():
    return []


@pytest.fixture
def chip():
    return Microcontroller("UI")


@pytest.fixture
def gpio(chip):
    return Gpio(chip)


# --- display ------------------------------------------------------------------------------------------


@pytest.fixture
def panel(chip):
    return FrontPanel(chip)


@pytest.fixture
def lcd(panel, gpio, said):
    return Lcd(gpio, said.append)


def test_the_display_starts_switched_on_and_empty(panel, lcd):
    assert panel.text() == " " * 8 + "\n" + " " * 8
    assert list(panel.words[:16]) == [32] * 16  # off, it would show zeros
    assert panel.display.two_lines and panel.display.wide_bus and panel.display.on


def test_four_quarters_make_two_lines(panel, lcd):
    for quarter, text in enumerate(("Walk", "ing ", "0.59", " m/s")):
        LcdQuarter(lcd, quarter).deliver(word(text), 0)
    for _ in range(16 * 51):
        lcd.tick()
    assert panel.text() == "Walking \n0.59 m/s"


def test_a_character_takes_fifty_one_milliseconds(panel, lcd):
    LcdQuarter(lcd, 0).deliver(word("AB  "), 0)
    lcd.tick()  # the cursor of the first
    for _ in range(49):
        assert lcd.tick() == 0
        assert panel.text().startswith("  ")
    lcd.tick()
    assert panel.text().startswith("A ")
    for _ in range(50):
        lcd.tick()
        assert panel.text().startswith("A ")
    lcd.tick()
    assert panel.text().startswith("AB")


def test_about_twenty_characters_a_second(lcd):
    for _ in range(25):
        LcdQuarter(lcd, 0).deliver(word("abcd"), 0)
    for _ in range(1000):
        lcd.tick()
    assert 19 <= lcd.written <= 20


def test_the_lowest_quarter_goes_first(panel, lcd):
    lcd.set_quarter(3, word("last"))
    lcd.set_quarter(1, word("mid1"))
    for _ in range(4 * 51):
        lcd.tick()
    assert panel.text() == "    mid1\n" + " " * 8


def test_a_full_queue_and_a_wrong_place_are_errors(lcd, said):
    assert [lcd.set_quarter(2, word("xxxx")) for _ in range(26)] == [4] * 25 + [0]
    assert said == [errors.LCD_STR_OF] * 4
    assert not lcd.put(16, 65)
    assert said[-1] == errors.LCD_POS_OOB


# --- lights -------------------------------------------------------------------------------------------


@pytest.fixture
def leds(chip, panel, gpio):
    return ColourLeds(SspMaster(chip, panel.ssp), gpio)


def ports(panel, driver):
    return list(panel.ssp.registers[REGISTERS * driver : REGISTERS * driver + 9])


@pytest.mark.parametrize("led", range(6))
def test_a_colour_command_is_red_green_blue_from_the_low_byte_up(panel, leds, led):
    LedReceiver(leds, led).deliver(0xE22B8A, 0)
    assert [panel.colour(i) for i in range(6)] == [0xE22B8A if i == led else 0 for i in range(6)]


def test_each_light_has_its_own_ports_on_its_own_driver(panel, leds):
    leds.set_led(4, 0x302010)  # light 5 of the robot: second driver, ports 3 blue, 4 green, 5 red
    assert ports(panel, 1) == [1, 1, 1, 0x30, 0x20, 0x10, 1, 1, 1]
    assert ports(panel, 0) == [1] * 9


def test_the_ends_of_the_scale_are_off_and_fully_on(panel, leds):
    for level, port in ((0, 1), (2, 1), (3, 3), (254, 254), (255, 0)):
        leds.set_colour(0, 2, level)
        assert ports(panel, 0)[2] == port
    assert panel.colour(0) == 0xFF
    assert [panel.ssp.registers[REGISTERS * driver + 0x10] for driver in range(2)] == [1, 1]


@given(st.integers(0, 5), st.integers(0, 0xFFFFFF))
def test_every_colour_reads_back_but_for_the_two_lowest_steps(led, colour):
    chip = Microcontroller("UI")
    panel = FrontPanel(chip)
    ColourLeds(SspMaster(chip, panel.ssp), Gpio(chip)).set_led(led, colour)
    for i in range(3):
        sent = colour >> (8 * i) & 0xFF
        assert panel.colour(led) >> (8 * i) & 0xFF == (0 if sent < 3 else sent)


# --- buzzer -------------------------------------------------------------------------------------------


@pytest.fixture
def buzzer(chip):
    return Buzzer(Pwm(chip, period=PERIOD_AT_START))


def play(buzzer, milliseconds):
    received = []
    for _ in range(milliseconds):
        buzzer.update()
        received.append(buzzer.hertz)
    return received


def test_a_tone_is_half_a_period_of_the_timer_and_audible(panel, buzzer):
    buzzer.tone(1000)
    assert (buzzer.pwm.latched_MR0, buzzer.pwm.latched_MR5) == (60000, 30000)
    assert panel.hertz == 1000
    buzzer.tone(0)
    assert buzzer.pwm.latched_MR5 == 0 and panel.hertz == 0


def test_the_tune_plays_once_on_command(buzzer):
    TuneStart(buzzer).deliver(1, 0)
    expected = [hertz for hertz, ms in TUNE for _ in range(ms)]
    assert play(buzzer, len(expected) + 100) == expected + [0] * 100
    assert buzzer.tunes_started == 1


def test_with_the_quirk_the_tune_never_ends(chip):
    buzzer = Buzzer(Pwm(chip, period=PERIOD_AT_START), False, True)
    TuneStart(buzzer).deliver(1, 0)
    expected = [hertz for hertz, ms in TUNE for _ in range(ms)]
    assert play(buzzer, 3 * len(expected)) == expected * 3


def test_a_zero_does_not_start_the_tune(buzzer):
    TuneStart(buzzer).deliver(0, 0)
    assert play(buzzer, 10) == [0] * 10


def test_an_error_beeps_once_for_sixty_milliseconds(buzzer):
    ErrorSound(buzzer).deliver(109 | 3 << 16 | 1 << 22, 0)
    assert play(buzzer, 200) == [1319] * 60 + [0] * 140
    assert buzzer.beeps_made == 1


def test_different_errors_sound_different_and_wait_for_each_other(buzzer):
    for code in (4, 5, 6, 7):
        buzzer.error_sound(code)
    received = play(buzzer, 600)
    pitches = [p for p, before in zip(received, [0] + received, strict=False) if p and not before]
    assert pitches == [1047, 1319, 1568, 2093]


def test_error_zero_is_silent_and_no_more_than_eight_beeps_wait(buzzer):
    ErrorSound(buzzer).deliver(3 << 16, 0)
    assert buzzer.beeps_waiting == 0
    for _ in range(20):
        buzzer.error_sound(62)
    play(buzzer, 2000)
    assert buzzer.beeps_made == 8


def test_as_the_firmware_of_2016_neither_errors_nor_a_frequency_alone_are_audible(chip):
    buzzer = Buzzer(Pwm(chip, period=PERIOD_AT_START), False, True)
    buzzer.error_sound(62)
    BuzzerFrequency(buzzer).deliver(440, 0)
    assert play(buzzer, 100) == [0] * 100


def test_a_frequency_command_sounds_when_beeps_are_on(buzzer):
    BuzzerFrequency(buzzer).deliver(440, 0)
    assert play(buzzer, 2) == [440] * 2
    BuzzerFrequency(buzzer).deliver(0xFFFFFFFF, 0)  # -1 Hz
    assert play(buzzer, 2) == [0] * 2


# --- keys ---------------------------------------------------------------------------------------------


def test_the_buttons_word_has_a_bit_per_key(chip, gpio, said):
    keypad = Keypad(gpio, said.append)
    assert keypad.buttons() == 0
    for key, pin in enumerate(KEY_PINS):
        chip.pins[pin] = 1
        assert keypad.pressed(key)
        assert keypad.buttons() == (2 << key) - 1
    assert not keypad.pressed(6)
    assert said == [errors.BUTTON_OOB]


def test_the_keys_hang_on_the_pins_of_the_board():
    # robot.md N4.11: P1.18, P0.12, P0.13, P0.28, P1.16, P0.30
    assert KEY_PINS == (32 + 18, 12, 13, 28, 32 + 16, 30)


# --- radio control ------------------------------------------------------------------------------------


def test_the_first_pulse_is_taken_as_it_is_and_the_next_move_a_sixteenth(said):
    rc = RcReceiver(said.append)
    rc.capture(0, 1, 1000)
    rc.capture(0, 0, 91000)
    assert rc.width(0) == 90000.0
    rc.capture(0, 1, 1000)
    rc.capture(0, 0, 1000 + 90000 + 1600)
    assert rc.width(0) == 90100.0
    assert rc.width(1) == 0.0


def test_a_pulse_across_the_timers_end_keeps_its_width(said):
    rc = RcReceiver(said.append)
    rc.capture(1, 1, 590_000)
    rc.capture(1, 0, 80_000)
    assert rc.width(1) == 90000.0


def test_two_equal_levels_are_an_error_and_the_pulse_is_forgotten(said):
    rc = RcReceiver(said.append)
    rc.capture(0, 1, 0)
    rc.capture(0, 1, 5000)
    assert said == [errors.RCX_BAD_LVLS]
    rc.capture(0, 0, 90_000)
    assert rc.pulses[0] == 0
    rc.capture(0, 1, 100_000)
    rc.capture(0, 0, 190_000)
    assert rc.width(0) == 90000.0


def test_a_channel_that_is_not_there_is_an_error(said):
    rc = RcReceiver(said.append)
    rc.capture(4, 1, 0)
    assert rc.width(-1) == 0.0
    assert said == [errors.RCX_BAD_CHAN] * 2


# --- sync light ---------------------------------------------------------------------------------------


def test_the_sync_light_starts_after_a_hundred_slots_of_key_four(chip, gpio, leds, said):
    light = SyncLight(gpio, Keypad(gpio, said.append), leds)
    chip.pins[KEY_PINS[4]] = 1
    for _ in range(60):
        light.watch_key()
    chip.pins[KEY_PINS[4]] = 0
    for _ in range(500):
        light.watch_key()
    chip.pins[KEY_PINS[4]] = 1
    for _ in range(39):
        light.watch_key()
    assert not light.running
    light.watch_key()
    assert light.running


def test_the_pattern_flashes_fifty_of_each_125_milliseconds_and_counts_up(chip, panel, gpio, leds, said):
    light = SyncLight(gpio, Keypad(gpio, said.append), leds)
    light.running = True
    lit = []
    for _ in range(12500):
        light.update()
        lit.append(light.lit)
        assert chip.pins[16] == (0 if light.lit else 1)
        assert (panel.colour(1) == 0xFFFFFF) == light.lit == panel.words[SYNC]
    flashes = [sum(lit[i * 1250 : (i + 1) * 1250]) // 50 for i in range(10)]
    assert flashes == [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]
    assert lit[:125] == [True] * 50 + [False] * 75
    assert light.flashes == 55
