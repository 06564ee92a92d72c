"""Edges of incremental encoders and words of absolute ones: counts, levels, times, errors of the disc."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.sensors.absolute_encoder import AbsoluteEncoder
from ranger_sim.plant.sensors.incremental_encoder import IncrementalEncoder
from tests.examples import examples

STEP = 125_000


def decode(encoder):
    """Count of a 2X decoder that sees the edges of the last step: rising with B low counts up, falling inverts."""
    count = 0
    for _, a, b in edges(encoder):
        count += 1 if a != b else -1
    return count


def edges(encoder):
    return [encoder.edges.edge(k) for k in range(encoder.edges.count)]


def test_one_turn_of_the_shaft_gives_two_edges_per_line():
    for lines, gear, sign in ((2048, 1.0, 1), (192, 66.0, 1), (512, 34.0, -1)):
        encoder = IncrementalEncoder("e", lines, gear, sign)
        start = 1e-4 * sign  # off an edge
        turn = 2.0 * math.pi / gear * sign
        encoder.reset(start)
        encoder.update(0, 10 * STEP, start, turn / 1.25e-3, start + turn, turn / 1.25e-3)
        assert encoder.edges.count == 2 * lines
        assert decode(encoder) == 2 * lines


def test_counts_times_the_firmwares_gain_are_the_angle():
    # robot.md N4.1: rad per count of the six encoders, signs included
    for lines, gear, sign, rad in (
        (2048, 1.0, 1, 1.53398e-3),
        (192, 66.0, 1, 2.47918e-4),
        (512, 34.0, -1, -1.80468e-4),
        (2048, 1.0, -1, -1.53398e-3),
        (512, 34.0, 1, 1.80468e-4),
    ):
        encoder = IncrementalEncoder("e", lines, gear, sign)
        encoder.update(0, STEP, 0.0, 0.0, 0.0, 0.0)
        count = 0
        angle = 0.0
        for k in range(200):
            encoder.update(k * STEP, (k + 1) * STEP, angle, 20.0, angle + 2.5e-3, 20.0)
            angle += 2.5e-3
            count += decode(encoder)
        assert count * rad == pytest.approx(angle, abs=1.1 * abs(rad) + 1e-5 * angle)


def test_the_loop_for_uneven_discs_finds_an_even_ones_edges():
    # a jitter too small to move any stamp sends the same motion through the other loop
    even, uneven = IncrementalEncoder("e", 512, 34.0), IncrementalEncoder("e", 512, 34.0, jitter=1e-300)
    angle, count = 0.3, 0
    for k in range(400):
        rate = 8.0 * math.cos(0.05 * k)
        following = angle + 1.01 * rate * STEP * 1e-9
        for encoder in (even, uneven):
            assert encoder.update(k * STEP, (k + 1) * STEP, angle, rate, following, rate) == encoder.edges.count
        assert edges(even) == edges(uneven) and even.cell == uneven.cell
        count += even.edges.count
        angle = following
    assert even.total == uneven.total == count > 500


def test_forward_motion_rises_with_b_low_and_falls_with_b_high():
    encoder = IncrementalEncoder("e", 100)
    encoder.reset(0.001)
    encoder.update(0, STEP, 0.001, 0.5 / 125e-6, 0.501, 0.5 / 125e-6)
    assert [pair[1:] for pair in edges(encoder)[:4]] == [(0, 1), (1, 0), (0, 1), (1, 0)]
    assert encoder.level_a() == edges(encoder)[-1][1]


def test_backward_motion_shows_the_same_edges_in_reverse():
    encoder = IncrementalEncoder("e", 100)
    encoder.reset(0.501)
    encoder.update(0, STEP, 0.501, -4000.0, 0.001, -4000.0)
    assert decode(encoder) == -encoder.edges.count
    first = [pair[1:] for pair in edges(encoder)[:4]]
    assert first in ([(1, 1), (0, 0), (1, 1), (0, 0)], [(0, 0), (1, 1), (0, 0), (1, 1)])


def test_edges_of_constant_speed_are_evenly_spaced():
    encoder = IncrementalEncoder("e", 512, 34.0)
    rate = 19.4  # 6300 rpm of the motor
    times = []
    for k in range(80):
        encoder.update(k * STEP, (k + 1) * STEP, rate * k * 125e-6, rate, rate * (k + 1) * 125e-6, rate)
        times += [edge[0] for edge in edges(encoder)]
    spacing = 1e9 / (512 * 34.0 / math.pi * rate)
    for n, time in enumerate(times, 1):
        assert abs(time - n * spacing) < 1.5  # truncated to whole ns


def test_107520_edges_per_second_come_at_6300_rpm():
    encoder = IncrementalEncoder("e", 512, 1.0)
    rate = 6300.0 * 2.0 * math.pi / 60.0
    total = 0
    for k in range(800):  # 0.1 s
        encoder.update(k * STEP, (k + 1) * STEP, rate * k * 125e-6, rate, rate * (k + 1) * 125e-6, rate)
        assert encoder.edges.count in (13, 14)
        total += encoder.edges.count
    assert total == 10752 - 1 or total == 10752


def test_edges_under_constant_acceleration_come_at_the_analytic_times():
    encoder = IncrementalEncoder("e", 512, 34.0)
    w, a = 10.0, 2000.0  # rad/s, rad/s^2: a hard push of the ankle motor
    k_edges = 512 * 34.0 / math.pi
    expected_worst = 0.0
    n = 0
    for k in range(20):
        t0, t1 = k * 125e-6, (k + 1) * 125e-6
        encoder.update(
            k * STEP, (k + 1) * STEP, w * t0 + a * t0 * t0 / 2, w + a * t0, w * t1 + a * t1 * t1 / 2, w + a * t1
        )
        for time, _, _ in edges(encoder):
            n += 1
            u = n / k_edges
            exact = (-w + math.sqrt(w * w + 2.0 * a * u)) / a
            expected_worst = max(expected_worst, abs(time - exact * 1e9))
    # inverse cubic against the true parabola: fourth order in the change of speed over a step (2.5 %)
    assert n > 100 and expected_worst < 2.0


def test_a_reversal_inside_a_step_gives_the_edges_out_and_back():
    encoder = IncrementalEncoder("e", 512, 34.0)
    per_rad = 512 * 34.0 / math.pi
    # parabola that turns at mid-step, 4.6 edges up, from 0.1 edges above one
    start = 0.1 / per_rad
    rate = 4.0 * 4.6 / per_rad / 125e-6
    encoder.reset(start)
    encoder.update(0, STEP, start, rate, start, -rate)
    shown = edges(encoder)
    assert len(shown) == 8
    assert decode(encoder) == 0 and encoder.cell == 0
    times = [edge[0] for edge in shown]
    assert times == sorted(times)
    for up, down in zip(times[:4], reversed(times[4:]), strict=True):
        assert up + down == pytest.approx(STEP, abs=3)  # symmetric about the turning point
    first = 0.5 * STEP * (1.0 - math.sqrt(1.0 - 0.9 / 4.6))
    assert times[0] == pytest.approx(first, abs=2)


def test_a_resting_encoder_has_no_edges():
    encoder = IncrementalEncoder("e", 2048)
    for k in range(10):
        encoder.update(k * STEP, (k + 1) * STEP, 0.3, 0.0, 0.3, 0.0)
        assert encoder.edges.count == 0


@settings(max_examples=examples(60))
@given(
    st.lists(
        st.tuples(st.floats(-0.02, 0.02), st.floats(-200.0, 200.0)),
        min_size=2,
        max_size=30,
    ),
    st.sampled_from([0.0, 0.02]),
    st.sampled_from([0.0, 0.05]),
)
def test_whatever_the_motion_a_decoder_of_the_edges_knows_the_position(points, line_error, jitter):
    encoder = IncrementalEncoder("e", 512, 34.0, 1, line_error=line_error, duty_error=0.0, jitter=jitter)
    encoder.reset(points[0][0])
    first = encoder.cell
    count = 0
    level = encoder.level_a()
    for k, ((a0, w0), (a1, w1)) in enumerate(zip(points, points[1:], strict=False)):
        encoder.update(k * STEP, (k + 1) * STEP, a0, w0, a1, w1)
        last = k * STEP
        for time, a, _ in edges(encoder):
            assert last <= time < (k + 1) * STEP
            assert a == 1 - level  # channel A alternates
            level = a
            last = time
        count += decode(encoder)
        assert first + count == encoder.cell
        assert abs(encoder.position(a1) - encoder.cell - 0.5) <= 0.5 + 0.1
    assert encoder.total >= abs(count)


def test_the_level_of_b_belongs_to_the_position():
    encoder = IncrementalEncoder("e", 100)
    per_rad = 100 / math.pi
    for u, a, b in ((0.25, 1, 0), (0.75, 1, 1), (1.25, 0, 1), (1.75, 0, 0), (2.25, 1, 0), (-0.25, 0, 0), (-0.75, 0, 1)):
        encoder.reset(u / per_rad)
        assert (encoder.level_a(), encoder.level_b(u / per_rad)) == (a, b), u


def test_jitter_moves_stamps_but_neither_counts_nor_order():
    plain = IncrementalEncoder("e", 512, 34.0, seed=3)
    noisy = IncrementalEncoder("e", 512, 34.0, jitter=0.1, seed=3)
    moved = 0
    for k in range(50):
        arguments = (k * STEP, (k + 1) * STEP, k * 1e-3, 8.0, (k + 1) * 1e-3, 8.0)
        plain.update(*arguments)
        noisy.update(*arguments)
        assert plain.edges.count == noisy.edges.count
        times = [edge[0] for edge in edges(noisy)]
        assert times == sorted(times)
        moved += sum(a[0] != b[0] for a, b in zip(edges(plain), edges(noisy), strict=True))
    assert moved > 200


def test_a_duty_error_lengthens_the_high_time_of_a():
    encoder = IncrementalEncoder("e", 512, duty_error=0.1)
    per_rad = 512 / math.pi
    rate = 40.0 / per_rad / 125e-6
    encoder.reset(0.5 / per_rad)
    encoder.update(0, STEP, 0.5 / per_rad, rate, 40.5 / per_rad, rate)
    times = [edge[0] for edge in edges(encoder)]
    levels = [edge[1] for edge in edges(encoder)]
    high = [b - a for a, b, level in zip(times, times[1:], levels, strict=False) if level == 1]
    low = [b - a for a, b, level in zip(times, times[1:], levels, strict=False) if level == 0]
    assert sum(high) / len(high) == pytest.approx(1.1 * STEP / 40, abs=1)
    assert sum(low) / len(low) == pytest.approx(0.9 * STEP / 40, abs=1)


def test_line_errors_belong_to_the_disc_and_repeat_every_turn():
    encoder = IncrementalEncoder("e", 16, line_error=0.02, seed=5)
    turns = []
    rate = 2.0 * math.pi / 125e-6
    for k in range(3):
        angle = 0.01 + 2.0 * math.pi * k
        encoder.update(k * STEP, (k + 1) * STEP, angle, rate, angle + 2.0 * math.pi, rate)
        turns.append([edge[0] - k * STEP for edge in edges(encoder)])
    assert all(abs(a - b) <= 1 for a, b in zip(turns[1], turns[2], strict=True))
    gaps = [b - a for a, b in zip(turns[1], turns[1][1:], strict=False)]
    assert max(gaps) - min(gaps) > 50


def test_an_eccentric_disc_shows_an_error_once_per_turn():
    encoder = IncrementalEncoder("e", 2048)
    encoder.eccentricity_1 = 0.01
    for angle in (0.0, 1.0, 2.0, 4.0):
        error = encoder.position(angle) / (2048 / math.pi) - angle
        assert error == pytest.approx(0.01 * math.sin(angle), abs=1e-12)


def test_more_edges_than_the_buffer_holds_are_kept():
    encoder = IncrementalEncoder("e", 2048)
    assert encoder.edges.capacity == 64
    encoder.update(0, STEP, 0.0005, 0.3 / 125e-6, 0.3005, 0.3 / 125e-6)
    assert encoder.edges.count == int(0.3005 * 2048 / math.pi) > 64
    assert encoder.edges.capacity >= encoder.edges.count


@pytest.mark.parametrize(
    "arguments",
    [
        dict(lines=0),
        dict(lines=10, gear=0.0),
        dict(lines=10, sign=2),
        dict(lines=10, line_error=0.2),
        dict(lines=10, duty_error=-0.5),
        dict(lines=10, jitter=-1.0),
    ],
)
def test_an_impossible_encoder_is_refused(arguments):
    with pytest.raises(UserError, match="encoder e"):
        IncrementalEncoder("e", **arguments)


def test_an_absolute_word_is_turned_back_into_the_angle_by_the_firmwares_zero_and_sign():
    # robot.md N4.7: zero, sign; position = sign (word - zero) 0.0007669922
    for zero, sign, angles in (
        (4590, 1, (-0.6, -0.001, 0.0, 0.35, 0.6)),
        (6562, -1, (0.0, 1.68, 3.2)),
        (1572, 1, (0.0, 1.68, 3.2)),
    ):
        encoder = AbsoluteEncoder("a", zero, sign, noise_counts=0.0)
        for angle in angles:
            assert sign * (encoder.word(angle) - zero) * 0.0007669922 == pytest.approx(angle, abs=0.00039)


def test_an_absolute_word_has_13_bits_and_wraps():
    encoder = AbsoluteEncoder("a", 8000, noise_counts=0.0)
    assert encoder.word(0.0) == 8000
    assert encoder.word(192 * 2.0 * math.pi / 8192) == 0
    assert encoder.word(-8001 * 2.0 * math.pi / 8192) == 8191


def test_the_noise_of_an_absolute_encoder_is_a_fraction_of_a_count():
    encoder = AbsoluteEncoder("a", 4590, noise_counts=0.3, seed=1)
    words = [encoder.word(0.1) for _ in range(4000)]
    # 0.1 rad are 130.380 counts: the next one shows when the noise exceeds 0.120 counts, 0.4 deviations
    part = 0.5 * math.erfc((130.5 - 0.1 * 8192 / (2 * math.pi)) / 0.3 / math.sqrt(2.0))
    assert sum(words) / len(words) == pytest.approx(4720 + part, abs=0.025)  # three deviations of the mean
    assert set(words) <= {4719, 4720, 4721, 4722}
    again = AbsoluteEncoder("a", 4590, noise_counts=0.3, seed=1)
    assert words == [again.word(0.1) for _ in range(4000)]


def test_a_flipped_bit_changes_the_word_by_a_power_of_two():
    encoder = AbsoluteEncoder("a", 4590, noise_counts=0.0, bit_flip=0.1, seed=2)
    wrong = [encoder.word(0.0) ^ 4590 for _ in range(2000)]
    assert all(x == 0 or x & (x - 1) == 0 for x in wrong)
    assert sum(x != 0 for x in wrong) == encoder.flipped == pytest.approx(200, abs=60)


def test_a_lag_of_an_absolute_encoder_follows_with_its_time_constant():
    encoder = AbsoluteEncoder("a", 0, noise_counts=0.0)
    encoder.lag_s = 0.01
    encoder.word(0.0)
    for _ in range(10):
        word = encoder.word(1.0, 0.001)
    assert word * 2 * math.pi / 8192 == pytest.approx(1.0 - math.exp(-1.0), abs=0.001)


@pytest.mark.parametrize("zero, sign", [(8192, 1), (-1, 1), (0, 0)])
def test_an_impossible_absolute_encoder_is_refused(zero, sign):
    with pytest.raises(UserError, match="absolute encoder a"):
        AbsoluteEncoder("a", zero, sign)


def test_an_angle_set_from_outside_gives_every_edge_on_the_way_to_it():
    # 200 edges in a step that itself moves by a hundredth of one, in both directions: the buffer holds 64 at first
    for sense in (1.0, -1.0):
        encoder = IncrementalEncoder("e", 512)
        encoder.reset(0.001)
        edge = math.pi / 512
        there = 0.001 + sense * 200 * edge
        rate = sense * 0.01 * edge / (STEP * 1e-9)
        encoder.update(0, STEP, there, rate, there + sense * 0.01 * edge, rate)
        assert encoder.edges.count == 200
        assert decode(encoder) == sense * 200


def test_an_edge_that_bounces_comes_three_times_and_the_count_is_unchanged():
    still, noisy = IncrementalEncoder("a", 2048), IncrementalEncoder("a", 2048, bounce=0.3, seed=5)
    came, counted = 0, [0, 0]
    for step in range(200):
        for i, each in enumerate((still, noisy)):
            each.update(step * STEP, (step + 1) * STEP, 0.002 * step, 16.0, 0.002 * step + 0.002, 16.0)
            if i == 1:
                before = each.edges.count
                more = each.add_bounces((step + 1) * STEP)
                assert each.edges.count == before + 2 * more
            counted[i] += decode(each)
        came += still.edges.count
        times = [time for time, _, _ in edges(noisy)]
        assert times == sorted(times) and all(step * STEP <= time < (step + 1) * STEP for time in times)
    # an edge every 96 us: nine tenths of them have the room
    assert noisy.bounces == pytest.approx(0.3 * came, rel=0.25)
    assert counted[0] == counted[1] == came
