"""Small modules of the motor boards: errors, contacts, absolute encoder, network time, LEDs, readings."""

import pytest

from ranger_sim.boards.modules.absolute_encoder import AbsoluteEncoder
from ranger_sim.boards.modules.error_module import ErrorModule, error_word
from ranger_sim.boards.modules.foot_contact import Debounce, FootContact
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.foundation.numbers import float32, float_of_word, word_of_float
from tests.boards.motor_bench import BOARDS, SLOT_NS, Bench

SPIKE = codes.AE_SPIKE


def error_module(**switches):
    return ErrorModule(3, NetworkTime(), **switches)


# --- errors -----------------------------------------------------------------------------------------------


def test_an_error_word_is_a_16_bit_code_a_6_bit_board_and_a_10_bit_count():
    assert error_word(0x6D, 3, 1) == 0x6D | 3 << 16 | 1 << 22
    assert error_word(0xFFFF, 63, 1023) == 0xFFFFFFFF
    assert error_word(1, 1, 5000) >> 22 == 5000 - 4 * 1024


def test_an_error_waits_with_its_count_and_the_time_of_its_first_occurrence():
    errors = error_module()
    errors.time.ms = 77
    errors.report(109)
    errors.report(109)
    errors.update()
    errors.time.ms = 99
    errors.report(109)
    errors.update()
    assert errors.take()
    assert errors.word == error_word(109, 3, 3)
    assert errors.stamp == 77
    assert not errors.take()


def test_in_the_firmware_of_2016_an_error_counts_once_per_slot():
    errors = error_module(per_event=False)
    for _ in range(5):
        errors.report(43)
    errors.update()
    errors.report(43)
    errors.update()
    errors.take()
    assert errors.word >> 22 == 2
    assert errors.totals[43] == 6


def test_a_sent_error_starts_a_new_count():
    errors = error_module()
    errors.report(43)
    errors.update()
    errors.take()
    errors.report(43)
    errors.update()
    errors.take()
    assert errors.word >> 22 == 1


def test_the_count_goes_from_1023_to_0():
    errors = error_module()
    for _ in range(1500):
        errors.report(43)
    errors.update()
    errors.take()
    assert errors.word >> 22 == 1500 - 1024


def test_errors_of_a_slot_leave_by_ascending_code_whichever_came_first():
    errors = error_module()
    for code in (90, 5, 90, 31, 32, 6):
        errors.report(code)
    errors.update()
    errors.report(4)
    errors.update()
    sent = []
    while errors.take():
        sent.append((errors.word & 0xFFFF, errors.word >> 22))
    assert sent == [(5, 1), (6, 1), (31, 1), (32, 1), (90, 2), (4, 1)]


def test_the_ring_holds_32_errors_and_drops_the_oldest():
    errors = error_module()
    for code in range(1, 41):
        errors.report(code)
    assert errors.update() == 40
    sent = []
    while errors.take():
        sent.append(errors.word & 0xFFFF)
    assert sent == list(range(9, 41))
    assert errors.dropped == 8


def test_a_full_ring_is_not_searched_so_a_repeated_error_waits_twice():
    errors = error_module()
    for code in range(1, 33):
        errors.report(code)
    errors.update()
    errors.report(32)
    errors.update()
    sent = []
    while errors.take():
        sent.append((errors.word & 0xFFFF, errors.word >> 22))
    assert sent == [(code, 1) for code in (*range(2, 33), 32)]


@pytest.mark.parametrize(("lose", "expected"), [(False, [43, 42, 45]), (True, [43, 42])])
def test_new_errors_after_a_repeated_one_are_lost_in_the_firmware_of_2016(lose, expected):
    errors = error_module(lose_new_after_repeat=lose)
    errors.report(43)
    errors.update()
    for code in (45, 43, 42):  # looked through from the lowest on, so 45 comes after the repeated one
        errors.report(code)
    errors.update()
    sent = []
    while errors.take():
        sent.append(errors.word & 0xFFFF)
    assert sent == expected


def test_a_code_outside_the_table_is_reported_as_0():
    errors = error_module()
    errors.report(5000)
    errors.report(-1)
    assert errors.totals[0] == 2


def test_a_board_sends_a_waiting_error_in_its_occasional_list():
    bench = Bench("MCH").run(ms=5)
    bench.board.errors.report(codes.AE_SPIKE)
    bench.run(ms=30)
    words = [word for _, identifier, word, _ in bench.frames if identifier == bench.table.ERROR_MCH]
    assert error_word(codes.AE_SPIKE, 3, 1) in words


# --- foot contact ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("samples", [10, 11])
def test_contact_changes_after_a_number_of_equal_samples(samples):
    foot = FootContact(2000, 1000, samples)
    for _ in range(samples - 1):
        foot.read(2001)
    assert foot.state == 0
    foot.read(2001)
    assert foot.state == 1
    for _ in range(samples - 1):
        foot.read(999)
    assert foot.state == 1
    foot.read(999)
    assert foot.state == 0


def test_one_other_sample_starts_the_counting_anew():
    foot = FootContact(2000, 1000, 10)
    for _ in range(9):
        foot.read(3000)
    foot.read(500)
    for _ in range(9):
        foot.read(3000)
    assert foot.state == 0
    foot.read(3000)
    assert foot.state == 1


def test_between_the_levels_the_old_level_stays():
    foot = FootContact(2000, 1000, 3)
    for counts in (2001, 1500, 1000):  # 1000 is not below 1000
        foot.read(counts)
    assert foot.state == 1
    for _ in range(20):
        foot.read(2000)
    assert foot.state == 1
    for _ in range(3):
        foot.read(999)
    for _ in range(20):
        foot.read(2000)  # not above 2000
    assert foot.state == 0


def test_a_limit_switch_needs_three_equal_samples():
    switch = Debounce(3)
    switch.sample(1)
    switch.sample(1)
    assert switch.state == 0
    switch.sample(1)
    assert switch.state == 1


@pytest.mark.parametrize(("quirks", "ms"), [(Quirks(), 5.0), (Quirks(contact_equal_samples=11), 5.5)])
def test_the_outer_board_reports_contact_5_or_5_and_a_half_ms_after_the_foot_is_down(quirks, ms):
    bench = Bench("MCFO", quirks).run(ms=5)
    bench.counts("left_foot", 6000, gain=1)
    start = bench.now
    while bench.board.left_foot.state == 0:
        bench.run(slots=1)
        assert bench.now - start < 20_000_000
    # the first slot after the change may still see the reading of the sequence before
    assert ms <= (bench.now - start) / 1e6 <= ms + 0.5
    assert bench.board.right_foot.state == 0


def test_only_the_inner_right_foot_lets_go_at_1500_counts():
    assert Bench("MCFI").board.right_foot.off_level == 1500
    assert Bench("MCFI").board.left_foot.off_level == 1000
    assert Bench("MCFO").board.right_foot.off_level == 1000
    assert Bench("MCFI", Quirks(inner_right_off_level=1000)).board.right_foot.off_level == 1000


# --- absolute encoder -------------------------------------------------------------------------------------


def absolute(zero=4590, sign=1, rpm=94):
    return AbsoluteEncoder(zero, sign, rpm, error_module(), SPIKE)


@pytest.mark.parametrize(("rpm", "step"), [(94, 11), (186, 17)])
def test_the_spike_limiter_allows_the_steps_of_the_joints_speed(rpm, step):
    encoder = absolute(rpm=rpm)
    assert encoder.largest_step == step
    encoder.accept(4600)
    encoder.accept(4600 + step)
    assert encoder.errors.totals[SPIKE] == 0
    encoder.accept(8000)
    assert encoder.value == 4600 + 2 * step
    encoder.accept(0)
    assert encoder.value == 4600 + step
    assert encoder.errors.totals[SPIKE] == 2


def test_the_first_reading_is_taken_as_it_is():
    encoder = absolute()
    encoder.accept(8191)
    assert encoder.value == 8191 and encoder.errors.totals[SPIKE] == 0


def test_ten_counts_above_zero_are_the_angle_the_image_sent():
    encoder = absolute()
    encoder.accept(4600)
    assert encoder.angle_rad() == float32(10 * float32(0.0007669922))
    assert encoder.angle == 502
    encoder = absolute()
    encoder.accept(4580)
    assert encoder.angle == -502  # 502.66, toward zero


def test_the_high_bits_of_the_transfer_are_ignored_and_the_sign_is_the_mounting():
    encoder = absolute(zero=6562, sign=-1, rpm=186)
    encoder.accept(0xE000 | 6552)
    assert encoder.counts == 10
    encoder = absolute(zero=1572, rpm=186)
    encoder.accept(1562)
    assert encoder.counts == -10


# --- constants per board ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "loop_gain", "gain", "offset"),
    [("MCH", 100, 0.00154, -9), ("MCFO", -99, -0.00152, 0), ("MCFI", 99, 0.001525, -1), ("MCSI", 10, 0.0001535, 25)],
)
def test_motor_current_is_scaled_by_full_constants_outside_and_truncated_ones_inside(name, loop_gain, gain, offset):
    bench = Bench(name).run(ms=2)
    bench.counts("motor_current", 1000)
    bench.run(ms=2)
    readings = bench.board.readings
    assert readings.motor_gain_fixed == loop_gain
    assert readings.motor_current_fixed() == -(1000 - offset) * loop_gain
    assert readings.motor_current() == pytest.approx(-gain * (1000 - offset), rel=1e-6)


@pytest.mark.parametrize(
    ("name", "gain", "offset", "amplifier", "volts_per_count"),
    [
        ("MCH", 0.000506, -4, 2, 0.0323),
        ("MCFO", 0.000502, -9, 2, 0.0327),
        ("MCFI", 0.000502, -3, 2, 0.0324),
        ("MCSI", 0.0000505, -75, 20, 0.0327),
    ],
)
def test_battery_readings_have_the_constants_of_their_board(name, gain, offset, amplifier, volts_per_count):
    bench = Bench(name).run(ms=2)
    bench.counts("battery_current", 800, gain=amplifier)
    bench.volts("battery_voltage", 3.3 * 800.5 / 1024)
    bench.run(ms=2)
    readings = bench.board.readings
    amperes, volts = gain * (800 - offset), volts_per_count * 800
    assert readings.battery_current() == pytest.approx(amperes, rel=1e-6)
    assert readings.battery_voltage() == pytest.approx(volts, rel=1e-6)
    assert readings.battery_power() == pytest.approx(amperes * volts, rel=1e-6)
    # the 16.16 product of the steering board has both gains truncated to 1/65536: 3 where 3.31 stood
    truncated = int(gain * 65536) / 65536 * (800 - offset) * (int(volts_per_count * 65536) / 65536 * 800)
    assert readings.battery_power_fixed() == pytest.approx(truncated, abs=1 / 65536)


def test_the_power_of_the_steering_board_is_a_tenth_too_low():
    # robot.md T4.4: 0.0898 W in the image where full gains give 0.0990
    bench = Bench("MCSI").run(ms=2)
    bench.counts("battery_current", 0, gain=20)
    bench.volts("battery_voltage", 3.3 * 800.5 / 1024)
    bench.run(ms=2)
    assert bench.board.readings.battery_power() == pytest.approx(0.0990, abs=5e-4)
    assert bench.board.readings.battery_power_fixed() == pytest.approx(0.0898, abs=5e-5)


def test_powers_and_currents_are_the_single_floats_of_the_image():
    # the hip's image at 1 and 10 ms: battery current 301 counts at 800 of the voltage, motor current 28 counts
    bench = Bench("MCH").run(ms=2)
    bench.counts("battery_current", 301)
    bench.counts("motor_current", 28)
    bench.volts("battery_voltage", 3.3 * 800.5 / 1024)
    bench.run(ms=2)
    readings = bench.board.readings
    assert word_of_float(readings.battery_power()) == word_of_float(
        float32(800 * 305 * float32(float32(0.0323) * float32(0.000506)))
    )
    assert word_of_float(readings.motor_current()) == word_of_float(-float32(37 * float32(0.00154))) == 0xBD6963DC


def test_the_steering_sensor_is_zeroed_at_power_up():
    bench = Bench("MCSI")
    bench.counts("steering_sensor", 4810)
    bench.run(ms=3)
    assert bench.board.zero == 4810
    bench.counts("steering_sensor", 4900)
    bench.run(ms=5)
    assert bench.values("STEER_ANGLE")[-1] == 90.0


# --- time, heartbeat, execution time --------------------------------------------------------------------------


def test_the_network_time_is_the_time_word_of_identifier_0():
    bench = Bench("MCFI", sync=False).run(ms=2)
    bench.receive(0, 1, 0xFFFFFFFE)
    bench.run(ms=1)
    assert bench.board.time.ms == 0xFFFFFFFE
    bench.frames.clear()
    bench.run(ms=10)
    # time stands still without sync; an error frame carries the time when it first came
    stamps = {stamp for _, identifier, _, stamp in bench.frames if identifier != bench.table.ERROR_MCFI}
    assert stamps == {0xFFFFFFFE}


def test_the_blue_light_flashes_50_ms_every_512_ms_and_stops_with_the_sync_frames():
    bench = Bench("MCH").run(ms=1100)
    blue = [(time, level) for time, pin, level in bench.pin_log if pin == 57]
    lit = [time for time, level in blue if level == 0]
    dark = [time for time, level in blue if level == 1]
    assert len(lit) == 2
    assert lit[1] - lit[0] == pytest.approx(512e6, abs=SLOT_NS)
    assert dark[0] - lit[0] == pytest.approx(50e6, abs=1.1 * SLOT_NS)
    bench.sync = False
    count = bench.board.heartbeat.beats
    bench.run(ms=600)
    assert bench.board.heartbeat.beats == count


@pytest.mark.parametrize("name", list(BOARDS))
def test_execution_times_are_sent_in_seconds_and_fit_the_slot(name):
    bench = Bench(name).run(ms=400)
    longest = bench.values("EXECUTION_TIME")[-1]
    ever = bench.values("MAX_EXECUTION_TIME")[-1]
    assert 0 < longest <= ever < 500e-6
    # the firmware's factor is 0.0000000166667, 2e-6 more than 1/60e6
    assert ever == pytest.approx(bench.board.execution.longest_ever / 60e6, rel=3e-6)
    # the record is the last entry of the row: its own cycles come after the reading
    assert 0 < bench.board.scheduler.max_slot_cycles - bench.board.execution.longest_ever < 1500


def test_the_execution_time_starts_anew_every_256_ms():
    bench = Bench("MCH").run(ms=300)
    task = bench.board.scheduler.find("hb_beat")
    cost = task.cost
    task.cost = 15000
    bench.run(ms=10)
    task.cost = cost
    assert bench.values("EXECUTION_TIME") and bench.board.execution.longest > 20000
    bench.run(ms=300)
    assert bench.board.execution.longest < 14000 < 20000 < bench.board.execution.longest_ever


def test_a_float_travels_as_its_32_bits():
    bench = Bench("MCH").run(ms=30)
    status = [word for _, identifier, word, _ in bench.frames if identifier == bench.table.MCH_STATUS]
    assert status and all(word == 0x3F800000 for word in status)
    assert float_of_word(status[0]) == 1.0
