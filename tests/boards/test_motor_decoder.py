"""Quadrature decoder: constants, counting, rate; and its fast interrupt on a running board."""

import pytest

from ranger_sim.boards.hip import JOINT_ENCODER as HIP_JOINT
from ranger_sim.boards.hip import MOTOR_ENCODER as HIP_MOTOR
from ranger_sim.boards.inner_feet import JOINT_ENCODER as INNER_JOINT
from ranger_sim.boards.inner_feet import MOTOR_ENCODER as INNER_MOTOR
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.modules.quadrature_decoder import QuadratureDecoder
from ranger_sim.boards.outer_feet import JOINT_ENCODER as OUTER_JOINT
from ranger_sim.boards.outer_feet import MOTOR_ENCODER as OUTER_MOTOR
from tests.boards.motor_bench import Bench

GLITCH, FULL = 41, 101


def decoder(pulses=2048, gear=1.0, exponent=4):
    return QuadratureDecoder(pulses, gear, ErrorModule(3, NetworkTime()), GLITCH, FULL, exponent)


# Constants that the six compiled images of the robot hold after their start (robot.md N4.1).
@pytest.mark.parametrize(
    ("encoder", "position_gain", "position_shift", "rate_gain", "rate_shift", "rad"),
    [
        (HIP_JOINT, 25735, 8, 11504, -3, 1.53398e-3),
        (HIP_MOTOR, 16637, 10, 14874, 0, 2.47918e-4),
        (OUTER_MOTOR, -24222, 11, -10828, 0, -1.80468e-4),
        (OUTER_JOINT, -25735, 8, -11504, -3, -1.53398e-3),
        (INNER_MOTOR, 24222, 11, 10828, 0, 1.80468e-4),
        (INNER_JOINT, 25735, 8, 11504, -3, 1.53398e-3),
    ],
)
def test_gains_are_the_integers_of_the_robots_images(
    encoder, position_gain, position_shift, rate_gain, rate_shift, rad
):
    qdc = decoder(*encoder)
    assert (qdc.position_gain, qdc.position_shift) == (position_gain, position_shift)
    assert (qdc.rate_gain, qdc.rate_shift) == (rate_gain, rate_shift)
    assert qdc.rad_per_count == pytest.approx(rad, rel=1e-5)  # printed to 6 digits


def test_position_is_the_floored_product_of_count_and_gain():
    qdc = decoder(*OUTER_MOTOR)
    qdc.count = 1000
    qdc.update_angle()
    assert qdc.position == (1000 * -24222) >> 11 == -11828  # -11827.15 floored
    qdc.count = -1000
    qdc.update_angle()
    assert qdc.position == 11827


def test_setting_a_position_truncates_the_count_towards_zero():
    qdc = decoder(*HIP_JOINT)
    qdc.set_position(32768)  # 0.5 rad
    assert qdc.count == (32768 << 8) // 25735 == 325
    qdc.set_position(-32768)
    assert qdc.count == -325


def test_a_steady_turn_settles_at_its_rate():
    qdc = decoder(*HIP_JOINT)
    for _ in range(400):
        for _ in range(3):
            qdc.edge(1, 9204)  # 60e6 pi/2048 / 9204 = 10.0 rad/s
        qdc.update_rate()
    assert qdc.rate / 65536 == pytest.approx(10.0, rel=2e-4)


def test_the_filter_moves_by_a_sixteenth_per_slot():
    qdc = decoder(*HIP_JOINT)
    qdc.sign = 1
    qdc.edge(1, 9204)
    qdc.update_rate()
    assert qdc.speed == 0x7FFFFFFF // 9204
    assert qdc.filtered == (qdc.speed << 16) >> 4


def test_another_exponent_filters_less():
    qdc = decoder(*HIP_JOINT, exponent=3)
    qdc.sign = 1
    qdc.edge(1, 9204)
    qdc.update_rate()
    assert qdc.filtered == (qdc.speed << 16) >> 3


def test_the_rate_takes_the_mean_of_all_times_of_a_slot():
    qdc = decoder()
    for elapsed in (9000, 11000, 10000):
        qdc.edge(1, elapsed)
    assert qdc.update_rate() == 3
    assert qdc.speed == 3 * (0x7FFFFFFF // 30000)
    assert qdc.mean == 10000


def test_without_edges_the_estimate_decays_as_one_over_time_and_never_stops():
    qdc = decoder()
    qdc.sign = 1
    qdc.edge(1, 30000)
    qdc.update_rate()
    speeds = []
    for _ in range(100):
        assert qdc.update_rate() is None
        speeds.append(qdc.speed)
    assert speeds[0] == 0x7FFFFFFF // 30000  # silence no longer than the last time yet
    assert speeds[1] == 0x7FFFFFFF // 60000
    assert speeds[99] == 0x7FFFFFFF // 3000000 > 0


def test_one_edge_backwards_waits_and_two_are_believed():
    qdc = decoder()
    for _ in range(3):
        qdc.edge(1, 10000)
    qdc.edge(-1, 12000)
    qdc.update_rate()
    assert qdc.sign == 1 and qdc.mean == 10000
    assert qdc.read != qdc.write  # the lone one waits in the ring
    qdc.edge(-1, 14000)
    qdc.update_rate()
    assert qdc.sign == -1
    assert qdc.speed == -2 * (0x7FFFFFFF // 26000)
    assert qdc.mean == -13000


def test_a_lone_change_of_direction_is_a_glitch_and_takes_the_next_time_with_it():
    qdc = decoder()
    qdc.sign = 1
    qdc.edge(1, 10000)
    qdc.edge(-1, 500)
    qdc.edge(1, 9500)
    qdc.edge(1, 10002)
    qdc.update_rate()
    assert qdc.errors.totals[GLITCH] == 1
    assert qdc.sign == 1
    assert qdc.speed == 2 * (0x7FFFFFFF // 20002)


def test_after_power_up_no_direction_is_known_so_the_first_time_waits_for_a_second():
    qdc = decoder()
    qdc.edge(1, 10000)
    assert qdc.update_rate() is None
    assert qdc.sign == 0 and qdc.rate == 0
    qdc.edge(1, 12000)
    assert qdc.update_rate() == 2
    assert qdc.sign == 1 and qdc.speed == 2 * (0x7FFFFFFF // 22000)


def test_a_glitch_at_the_rings_end_costs_the_first_time_of_the_next_slot():
    qdc = decoder()
    for _ in range(3):
        qdc.edge(1, 10000)
    qdc.glitch()
    assert qdc.update_rate() == 4
    qdc.edge(1, 77)
    qdc.update_rate()
    assert qdc.mean == 30000  # as in a slot of silence, instead of 77 cycles
    qdc.edge(1, 12000)
    qdc.update_rate()
    assert qdc.mean == 12000


@pytest.mark.parametrize("direction", [1, -1])
def test_the_filter_keeps_its_fraction_so_a_slow_rate_has_no_bias(direction):
    qdc = decoder(*HIP_JOINT)
    for _ in range(2):
        qdc.edge(direction, 0x7F000000)
    for _ in range(2000):
        qdc.update_rate()
    # one count in 0x7F000000 cycles is 1.0078 x 2^-31 counts per cycle, whose whole part is 1: one count in 36 s is
    # 4.3e-5 rad/s, 2.8 in the last place, floored; flooring each step's state would leave a rate of 0 or -20
    assert qdc.speed == direction
    assert qdc.rate == (2 if direction > 0 else -3)


def test_a_wrong_level_stores_a_zero_that_takes_the_next_time_with_it():
    qdc = decoder()
    qdc.glitch()
    qdc.edge(1, 77)
    qdc.edge(1, 10000)
    qdc.update_rate()
    assert qdc.errors.totals[GLITCH] == 1
    assert qdc.count == 2
    assert qdc.speed == 0x7FFFFFFF // 10000


def test_a_full_ring_loses_times_but_no_counts():
    qdc = decoder()
    for _ in range(70):
        qdc.edge(1, 600)
    assert qdc.count == 70
    assert qdc.dropped_times == 70 - 63
    assert qdc.errors.totals[FULL] == 7
    assert qdc.update_rate() == 63


def test_negative_gears_turn_angle_and_rate_round():
    qdc = decoder(*OUTER_JOINT)
    for _ in range(300):
        qdc.edge(1, 9204)
        qdc.update_rate()
    qdc.update_angle()
    assert qdc.position < 0 and qdc.rate / 65536 == pytest.approx(-10.0, rel=1e-3)


# --- through pins, capture and fast interrupt -------------------------------------------------------------


def test_every_edge_of_a_turning_motor_is_counted_in_the_fast_interrupt():
    bench = Bench("MCFI").run(ms=1)
    bench.board.motor.set_position(0)
    bench.turn(1000, 9_300, forward=True, pair="01")
    bench.run(ms=12)
    assert bench.board.motor.count == 1000
    assert bench.board.scheduler.overruns == 0


@pytest.mark.parametrize("earlier", [(), ((1, 0),)])  # waiting for a rising edge, for a falling one
@pytest.mark.parametrize("b", [0, 1])
def test_a_rising_edge_with_b_low_counts_up_and_a_falling_edge_inverts(earlier, b):
    bench = Bench("MCH").run(ms=1)
    joint = bench.board.joint
    a = 1 - len(earlier)
    for levels in (*earlier, (a, b)):
        bench.edge(*levels, "01", after_ns=100_000)
        joint.set_position(0)
        bench.run(ms=0.15)
    step = 1 if a != b else -1
    assert joint.count == step
    assert joint.ring[len(earlier)] * step > 0


def test_full_speed_at_107520_edges_a_second_loses_nothing_and_leaves_half_the_slot():
    bench = Bench("MCFI").run(ms=1)
    bench.board.motor.set_position(0)
    for i in range(2150):
        a = 1 - (i & 1)
        bench.edge(a, 1 - a, "01", after_ns=(i + 1) * 1_000_000_000 // 107_520)
    for i in range(250):
        a = 1 - (i & 1)
        bench.edge(a, 1 - a, "23", after_ns=(i + 1) * 79_000 + 3)
    bench.run(ms=21)
    assert bench.board.motor.count == 2150
    assert bench.board.timer0.lost[0] == 0
    assert bench.board.errors.totals[GLITCH] == 0
    # 6300 rpm / 34 is 19.4 rad/s
    assert bench.board.motor.rate / 65536 == pytest.approx(19.4, rel=0.15)
    assert bench.board.scheduler.overruns == 0
    # 54 edges a slot at 47 instructions in the interrupt and 24 in the task are 128 us of it
    assert 0.4 < bench.board.scheduler.max_slot_cycles / 30000 < 0.5


def newest(decoder, count):
    """The edge times stored last."""
    return [decoder.ring[(decoder.write - count + i) & 63] for i in range(count)]


def test_the_time_between_edges_counts_the_timers_wraps():
    bench = Bench("MCH").run(ms=1)
    bench.edge(1, 0, "01", after_ns=100_000)
    bench.edge(0, 1, "01", after_ns=100_000 + 1_700_000)
    bench.run(ms=3)
    stored = newest(bench.board.joint, 1)[0]
    assert abs(stored - 102_000) <= 1  # 1.7 ms in 1/60 us


def test_a_pulse_that_ends_before_its_interrupt_is_served_is_a_glitch():
    bench = Bench("MCH").run(ms=1)
    bench.board.joint.set_position(0)
    bench.edge(1, 0, "23", after_ns=99_500)  # keeps the fast interrupt busy for 2.5 us
    bench.edge(1, 0, "01", after_ns=100_000)
    bench.edge(0, 0, "01", after_ns=101_000)
    bench.run(ms=1)
    assert bench.board.joint.glitches == 1
    assert bench.board.joint.count == 0
    assert bench.board.timer0.lost[0] == 1
    assert bench.errors()["QDC_CH01_GLTCH"] == 1
    bench.edge(1, 0, "01", after_ns=100_000)
    bench.run(ms=1)
    assert bench.board.joint.count == 1


def test_an_edge_at_the_very_time_of_a_wrap_is_timed_right():
    bench = Bench("MCH").run(ms=1)
    bench.edge(1, 0, "01", after_ns=400_000)
    bench.edge(0, 1, "01", after_ns=500_000)  # the timer wraps every 0.5 ms from power-up on
    bench.edge(1, 0, "01", after_ns=600_000)
    bench.run(ms=1)
    assert newest(bench.board.joint, 2) == [6000, 6000]


@pytest.mark.parametrize(
    ("waits", "capture", "wrapped"),
    [(1, 0, True), (1, 14_999, True), (1, 15_000, False), (1, 29_999, False), (0, 14_999, False)],
)
def test_a_wrap_that_is_not_counted_yet_came_before_an_early_capture_alone(waits, capture, wrapped):
    edges = Bench("MCH").run(ms=3).board.capture01
    edges.timer.IR = waits  # match 0: the counter began anew, and its interrupt has not run
    edges.timer.captures = [capture] * len(edges.timer.captures)  # compiled, an element is that of a copy
    edges.on_capture(None)
    assert edges.last == edges.wraps.cycles + capture + (30_000 if wrapped else 0)
