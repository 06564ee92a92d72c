"""The user interface board whole: what it sends, shows, sounds and receives; alone on the table."""

import pathlib
import struct
import subprocess
import sys

import pytest

from ranger_sim.boards.modules.buzzer import TUNE
from ranger_sim.boards.modules.front_panel import KEY_PINS
from ranger_sim.boards.quirks import Quirks
from ranger_sim.boards.user_interface import IMU_UART, PINS, UserInterfaceBoard
from ranger_sim.datatable.generated import errors
from ranger_sim.datatable.generated import ui as table
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.foundation.events import UART_BYTE
from ranger_sim.foundation.numbers import float32, float_of_word
from tests.boards.wires import Wires

MS = 1_000_000


def build(quantum=25_000, phase_ns=0, crystal=None, **quirks):
    board = UserInterfaceBoard(crystal or Crystal(), Quirks.named(**quirks), phase_ns)
    return Wires(board, None, quantum)


def packet(header, values, timer=0):
    body = bytes([header]) + struct.pack(">6f", *values) + struct.pack(">I", timer)
    return body + struct.pack(">H", sum(body) & 0xFFFF)


def command(wires, identifier, word0):
    """A frame from the main brain, now, and the slot that reads it."""
    wires.frame(wires.time + 1000, 2, identifier, word0 & 0xFFFFFFFF, 0)
    wires.run(wires.time + 2 * MS)


def letters(text):
    return sum(ord(c) << (8 * i) for i, c in enumerate(text))


# --- what it sends ------------------------------------------------------------------------------------


def test_the_frames_of_a_second_are_those_of_the_firmware():
    wires = build().run(45 * 45 * MS)
    count = {}
    for _, bus, identifier, flags, _, _ in wires.sent:
        assert (bus, flags) == (2, 8)
        count[identifier] = count.get(identifier, 0) + 1
    # in 2025 slots: 675 passes of three rows, 45 rounds of fifteen occasional calls (robot.md N3.6)
    twice = {table.UI_ROLL: 675 + 45, table.UI_ANG_RATE_X: 675}
    once = [
        table.UI_BUTTONS, table.UI_RC_0, table.UI_RC_1, table.UI_STATUS, table.UI_EXECUTION_TIME,
        table.UI_MAX_EXECUTION_TIME, table.UI_PITCH, table.UI_YAW, table.UI_ANG_RATE_Y, table.UI_ANG_RATE_Z,
        table.UI_RC_2, table.UI_RC_3,
    ]  # fmt: skip
    assert count == twice | dict.fromkeys(once, 45)
    # 955.6 frames a second (robot.md N1.10)
    assert sum(count.values()) / 2.025 == pytest.approx(955.6, abs=0.1)


def test_the_occasional_list_runs_in_the_order_of_the_firmware():
    wires = build().run(46 * MS)
    order = [s[2] for s in wires.sent if s[2] not in (table.UI_ANG_RATE_X,)]
    names = [table.NAMES[i] for i in order if i != table.UI_ROLL]
    assert names == [
        "UI_BUTTONS", "UI_RC_0", "UI_RC_1", "UI_STATUS", "UI_EXECUTION_TIME", "UI_MAX_EXECUTION_TIME",
        "UI_PITCH", "UI_YAW", "UI_ANG_RATE_Y", "UI_ANG_RATE_Z", "UI_RC_2", "UI_RC_3",
    ]  # fmt: skip


def test_the_every_slot_list_is_that_of_the_firmware():
    schedule = build().board.scheduler.schedule
    assert [task.name for task in schedule.every] == [
        "receive_all", "beat", "update", "update_imu", "update_errors", "feed",
        "watch_sync_key", "update_sync_light", "update_buzzer",
    ]  # fmt: skip
    assert [[task.name for task in row] for row in schedule.rows] == [
        ["UI_ROLL"], ["UI_ANG_RATE_X"], ["occasional"],
    ]  # fmt: skip


def test_interrupts_have_the_slots_of_the_firmware():
    vic = build().board.vic
    assert vic.fiq_list == []
    assert {n: s.name for n, s in enumerate(vic.irq_list) if s} == {
        0: "can_receive", 1: "slot timer", 2: "timer0 capture", 3: "uart1", 9: "can_error",
    }  # fmt: skip


def test_frames_carry_the_network_time_last_received():
    wires = build().run(10 * MS)
    wires.frame(10 * MS + 100, 2, table.TIMESTAMP, 4711, 4711)
    wires.run(15 * MS)
    assert wires.sent[0][5] == 0
    assert wires.sent[-1][5] == 4711


def test_it_reports_that_it_lives_and_how_long_its_slots_take():
    wires = build().run(200 * MS)
    assert {float_of_word(w0) for _, w0, _ in wires.of(table.UI_STATUS)} == {1.0}
    longest = float_of_word(wires.of(table.UI_MAX_EXECUTION_TIME)[-1][1])
    board = wires.board
    assert longest == float32(board.execution.longest_ever * float32(0.0000000166667))
    # the record is the last entry of its row: only its own cycles come after it
    assert board.scheduler.max_slot_cycles - 45 <= board.execution.longest_ever < board.scheduler.max_slot_cycles


def test_a_crystal_that_is_slow_makes_fewer_slots():
    # 0.1 % slow: 999 ms of its own time
    wires = build(crystal=Crystal(10_000_000, -1_000_000)).run(1000 * MS)
    assert wires.board.scheduler.slot_count == 999


# --- inertial sensor ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("switch", "header"), [("rates", 0xC2), ("euler_and_rates", 0xCF)])
def test_it_asks_once_for_the_packets_that_the_switch_wants(switch, header):
    wires = build(imu_packets=switch).run(500 * MS)
    assert [b for _, b in wires.uart] == [0xC4, 0xC1, 0x29, header]
    # 460 526 baud: 21.7 us per byte
    times = [t for t, _ in wires.uart]
    assert [b - a for a, b in zip(times, times[1:], strict=False)] == pytest.approx([21714] * 3, abs=2)


def test_rates_at_a_kilohertz_are_published_three_times_in_nine_milliseconds():
    wires = build()
    for n in range(100):
        data = packet(0xC2, (0, 0, 1, 0.01 * n, -1.0, 2.0))
        wires.bytes(n * MS, IMU_UART, data)
    wires.run(100 * MS)
    assert wires.board.imu.packets == 99
    rates = [(t, float_of_word(w0)) for t, w0, _ in wires.of(table.UI_ANG_RATE_X)]
    # row 1 is at 1, 4, 7 ... ms and sends the packet that was whole by then: the one begun a ms before
    assert rates == [(t, float32(0.01 * (t // MS - 1))) for t, _ in rates]
    assert len(rates) == 33
    assert {w0 for _, w0, _ in wires.of(table.UI_ROLL)} == {0}


def test_angles_and_rates_of_the_31_byte_packet_are_published_one_packet_late():
    wires = build(imu_packets="euler_and_rates")
    for n in range(60):
        wires.bytes(n * MS, IMU_UART, packet(0xCF, (0.1 * n, 0.2, 0.3, 0.4, 0.5, 0.6)))
    wires.run(60 * MS)
    rolls = [(t // MS, float_of_word(w0)) for t, w0, _ in wires.of(table.UI_ROLL)]
    # the parser wants more than 31 bytes, so a packet is read after the next one has begun
    assert rolls[10:] == [(ms, float32(0.1 * (ms - 2))) for ms, _ in rolls[10:]]
    for identifier, value in ((143, 0.2), (144, 0.3), (145, 0.4), (146, 0.5), (147, 0.6)):
        assert float_of_word(wires.of(identifier)[-1][1]) == float32(value)


def test_a_silent_sensor_leaves_its_last_values_on_the_bus():
    wires = build()
    wires.bytes(0, IMU_UART, packet(0xC2, (0, 0, 0, 0.75, 0, 0)))
    wires.run(300 * MS)
    assert float_of_word(wires.of(table.UI_ANG_RATE_X)[-1][1]) == 0.75


def test_bytes_in_groups_of_eight_make_the_same_run_as_single_bytes():
    runs = []
    for group in (1, 8):
        wires = build()
        for n in range(30):
            wires.bytes(n * MS + 137_000, IMU_UART, packet(0xC2, (0, 0, 0, n, 0, 0)), group)
        wires.run(30 * MS)
        source = wires.board.vic.source(UART_BYTE, IMU_UART)
        runs.append((wires.sent, source.served, source.total_cycles, wires.board.imu.packets))
    assert runs[0] == runs[1]
    # three interrupts at the trigger level and one when the last seven bytes have waited
    assert runs[0][1] == 30 * 4


def test_noise_on_the_serial_line_is_survived():
    wires = build()
    data = bytes((i * 37 + i * i) & 0xFF for i in range(700))
    wires.bytes(0, IMU_UART, data)
    for n in range(20):
        wires.bytes((20 + n) * MS, IMU_UART, packet(0xC2, (0, 0, 0, 5.0, 0, 0)))
    wires.run(50 * MS)
    assert float_of_word(wires.of(table.UI_ANG_RATE_X)[-1][1]) == 5.0
    assert wires.board.scheduler.overruns == 0


# --- keys and radio -----------------------------------------------------------------------------------


def test_a_pressed_key_is_on_the_bus_within_one_round_of_the_occasional_list():
    wires = build().run(100 * MS)
    wires.pin(100 * MS + 10, PINS["key_3"], 1)
    wires.pin(100 * MS + 20, PINS["key_0"], 1)
    wires.run(146 * MS)
    assert [w0 for _, w0, _ in wires.of(table.UI_BUTTONS)] == [0, 0, 0, 0b001001]
    wires.pin(146 * MS + 10, PINS["key_3"], 0)
    wires.run(192 * MS)
    assert wires.of(table.UI_BUTTONS)[-1][1] == 0b000001


def test_radio_pulses_are_measured_in_sixtieths_of_a_microsecond():
    wires = build()
    for n in range(20):
        wires.pin(n * 20 * MS + 3000, PINS["radio_0"], 1)
        wires.pin(n * 20 * MS + 3000 + 1_500_000, PINS["radio_0"], 0)
        wires.pin(n * 20 * MS + 9_500_000, PINS["radio_1"], 1)  # across the end of the timer
        wires.pin(n * 20 * MS + 9_500_000 + 1_100_000, PINS["radio_1"], 0)
    wires.run(400 * MS)
    assert float_of_word(wires.of(table.UI_RC_0)[-1][1]) == pytest.approx(90_000, abs=1)
    assert float_of_word(wires.of(table.UI_RC_1)[-1][1]) == pytest.approx(66_000, abs=1)
    assert float_of_word(wires.of(table.UI_RC_2)[-1][1]) == 0.0
    assert wires.board.rc.pulses[0] == 20


def test_a_missing_edge_is_an_error_and_no_wrong_width():
    wires = build()
    for start, end in ((3, 4.5), (23, None), (43, 44.5)):
        wires.pin(int(start * MS), PINS["radio_3"], 1)
        if end:
            wires.pin(int(end * MS), PINS["radio_3"], 0)
    wires.run(100 * MS)
    assert wires.board.errors.totals[errors.RCX_BAD_LVLS] == 1
    assert wires.board.rc.filtered[3] == pytest.approx(90_000, abs=1)


# --- what a person sees and hears ---------------------------------------------------------------------


def test_words_from_the_main_brain_appear_on_the_display():
    wires = build()
    for quarter, text in enumerate(("stan", "dby ", "25.1", " V  ")):
        command(wires, 130 + quarter, letters(text))
    wires.run(900 * MS)
    assert wires.board.panel.text() == "standby \n25.1 V  "


def test_six_light_commands_per_slot_colour_six_lights():
    wires = build()
    colours = [0x0000FF, 0x00FF00, 0xFF0000, 0x123456, 0, 0xE22B8A]
    for led, colour in enumerate(colours):
        wires.frame(1000 + led * 37_000, 2, 134 + led, colour, 0)
    wires.run(3 * MS)
    assert [wires.board.panel.colour(led) for led in range(6)] == colours


def test_a_song_command_plays_the_tune_once():
    wires = build().run(5 * MS)
    command(wires, table.UI_EMPTY_TX2, 1)
    wires.run(100 * MS)
    assert wires.board.panel.hertz == TUNE[0][0]
    wires.run(3000 * MS)
    assert wires.board.panel.hertz == 0
    assert wires.board.buzzer.tunes_started == 1


def test_an_error_of_another_board_beeps_and_with_the_quirk_it_does_not():
    received = {}
    for beeps in (True, False):
        wires = build(buzzer_beeps=beeps).run(5 * MS)
        command(wires, table.ERROR_LCD, errors.AE_SPIKE | 3 << 16 | 1 << 22)
        received[beeps] = wires.board.panel.hertz
    assert received == {True: 1319, False: 0}


def test_its_own_errors_beep_too_and_go_out_with_board_and_time():
    wires = build()
    wires.frame(1000, 2, table.TIMESTAMP, 77, 77)
    wires.run(5 * MS)
    wires.board.lcd.put(16, 65)
    wires.run(10 * MS)
    assert wires.board.panel.hertz > 0
    wires.run(100 * MS)
    word = errors.LCD_POS_OOB | table.BOARD_NUMBER << 16 | 1 << 22
    assert [(w0, w1) for _, w0, w1 in wires.of(table.ERROR_VARIABLE)] == [(word, 77)]


def test_key_four_held_for_a_hundred_slots_starts_the_sync_light():
    wires = build().run(10 * MS)
    wires.pin(10 * MS + 10, KEY_PINS[4], 1)
    wires.run(109 * MS)
    assert not wires.board.sync_light.running
    wires.run(113 * MS)
    assert wires.board.sync_light.lit
    assert wires.board.panel.colour(1) == 0xFFFFFF
    assert wires.board.pins[PINS["sync_light"]] == 0
    wires.pin(113 * MS + 10, KEY_PINS[4], 0)
    wires.run(170 * MS)
    assert not wires.board.sync_light.lit


def test_the_blue_led_beats_while_the_time_runs():
    wires = build()
    for n in range(1200):
        wires.frame(n * MS + 250_000, 2, table.TIMESTAMP, n, n)
    wires.run(1200 * MS)
    assert wires.board.heartbeat.beats == 2
    wires.run(3000 * MS)
    assert wires.board.heartbeat.beats == 2


# --- load ---------------------------------------------------------------------------------------------


def test_the_busiest_slot_keeps_far_from_its_millisecond_and_no_task_exceeds_its_limit():
    wires = build()
    for n in range(400):
        start = n * MS
        wires.bytes(start, IMU_UART, packet(0xC2, (0, 0, 0, 1.0, 0, 0)))
        wires.frame(start + 250_000, 2, table.TIMESTAMP, n, n)
        for led in range(6):  # every ms, twice as often as on the robot
            wires.frame(start + 300_000 + led * 37_000, 2, 134 + led, n, 0)
    for quarter in range(4):
        wires.frame(100 * MS + 600_000 + quarter * 37_000, 2, 130 + quarter, letters("abcd"), 0)
    wires.run(400 * MS)
    scheduler = wires.board.scheduler
    assert scheduler.overruns == 0
    assert scheduler.max_slot_cycles < 0.25 * 60_000
    assert [task.name for task in scheduler.schedule.all_tasks() if task.hits] == []
    assert sum(wires.board.errors.totals) == 0
    assert wires.board.can.receive_lost == 0


def test_a_task_that_runs_away_is_an_overrun_with_its_error():
    wires = build().run(10 * MS)
    wires.board.scheduler.replace("update_buzzer", lambda: None, cost=61_000)
    wires.run(12 * MS)
    wires.board.scheduler.replace("update_buzzer", lambda: None, cost=50)
    wires.run(30 * MS)
    assert wires.board.scheduler.overruns >= 1
    assert wires.board.errors.totals[errors.ASCHED_DNF] == wires.board.scheduler.overruns
    assert wires.board.errors.totals[errors.SCHED_TASK_LIMIT] >= 1


# --- the same run whatever the steps ------------------------------------------------------------------


def trace(quantum):
    wires = build(quantum=quantum, crystal=Crystal(10_000_000, 23_456), phase_ns=77_777)
    for n in range(40):
        wires.bytes(n * MS + 5000, IMU_UART, packet(0xC2, (0, 0, 0, 0.001 * n * n, 0.1, -0.1 * n)))
        wires.frame(n * MS + 251_003, 2, (0, 134, 141)[n % 3], n, n)
        wires.pin(n * MS + 100_101, PINS["radio_0"], n % 2)
    wires.run(40 * MS)
    board = wires.board
    return wires.sent, board.scheduler.total_slot_cycles, list(board.rc.filtered), board.buzzer.hertz


def test_the_run_does_not_depend_on_the_size_of_its_steps():
    assert trace(25_000) == trace(4_000) == trace(1_237)


def test_compiled_and_interpreted_runs_are_equal_to_the_bit():
    script = (
        "import hashlib, tests.boards.test_user_interface_board as t\n"
        "print(hashlib.sha256(repr(t.trace(25_000)).encode()).hexdigest())\n"
    )
    answers = {
        subprocess.run(
            [sys.executable, "-c", script],
            env={"RANGER_SIM_INTERPRETED": forced, "PATH": ""},
            capture_output=True,
            text=True,
            check=True,
            cwd=pathlib.Path(__file__).parents[2],
        ).stdout
        for forced in ("0", "1")
    }
    assert len(answers) == 1
