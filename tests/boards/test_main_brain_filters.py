"""Butterworth filters of the estimator: coefficients, delay, and the two ways of running them."""

import math

import pytest

from ranger_sim.boards.main_brain.filters import ButterworthFilter


def test_the_record_walks_filter_has_the_robots_coefficients():
    low_pass = ButterworthFilter(10.0, 1000.0)
    # robot.md C3.1, printed to 14 decimals
    assert low_pass.b0 == pytest.approx(0.00094469184384, abs=5e-15)
    assert low_pass.b1 == 2.0 * low_pass.b0
    assert low_pass.b2 == low_pass.b0
    assert low_pass.a1 == pytest.approx(-1.911197067426073, abs=1e-14)
    assert low_pass.a2 == pytest.approx(0.914975834801434, abs=1e-14)


@pytest.mark.parametrize(
    "cutoff, b0, a1, a2",
    [  # robot.md C3.2, printed to 9 decimals
        (20.0, 0.013359200, -1.647459981, 0.700896781),
        (10.0, 0.003621682, -1.822694925, 0.837181651),
    ],
)
def test_the_filters_of_2016_have_the_robots_coefficients(cutoff, b0, a1, a2):
    low_pass = ButterworthFilter(cutoff, 500.0)
    assert (low_pass.b0, low_pass.a1, low_pass.a2) == pytest.approx((b0, a1, a2), abs=6e-10)


def test_a_ramp_comes_out_22_and_a_half_ms_late():
    low_pass = ButterworthFilter(10.0, 1000.0)
    for ms in range(2000):
        low_pass.push_stamped(0.001 * ms, ms)
    # delay of a settled ramp = group delay at DC; robot.md C3.1 gives 22.5 ms
    assert 1999 - 1000.0 * low_pass.output == pytest.approx(22.5, abs=0.05)


def test_ten_hertz_is_damped_to_the_root_of_one_half():
    low_pass = ButterworthFilter(10.0, 1000.0)
    largest = 0.0
    for ms in range(3000):
        y = low_pass.push(math.sin(2.0 * math.pi * 10.0 * ms / 1000.0))
        if ms > 2000:
            largest = max(largest, abs(y))
    # 100 samples per period: the largest sample is within 1 - cos(pi/100) = 5e-4 of the amplitude
    assert largest == pytest.approx(math.sqrt(0.5), rel=1e-3)


def test_a_stamp_n_ms_later_runs_the_filter_n_times_with_the_old_value_held():
    stamped, each_ms = ButterworthFilter(10.0, 1000.0), ButterworthFilter(10.0, 1000.0)
    stamped.push_stamped(1.0, 100)
    each_ms.push(1.0)
    stamped.push_stamped(5.0, 103)
    for value in (1.0, 1.0, 5.0):
        each_ms.push(value)
    assert stamped.output == each_ms.output
    stamped.push_stamped(-2.0, 104)
    each_ms.push(-2.0)
    assert stamped.output == each_ms.output


def test_a_datum_with_the_same_stamp_is_held_until_the_next_one_arrives():
    stamped, each_ms = ButterworthFilter(10.0, 1000.0), ButterworthFilter(10.0, 1000.0)
    stamped.push_stamped(0.0, 7)
    each_ms.push(0.0)
    first = stamped.push_stamped(1.0, 8)
    each_ms.push(1.0)
    assert stamped.push_stamped(1.0, 8) == first
    assert stamped.push_stamped(99.0, 8) == first
    stamped.push_stamped(5.0, 10)
    for value in (99.0, 5.0):
        each_ms.push(value)
    assert stamped.output == each_ms.output


def test_the_first_datum_sets_the_filter_to_rest():
    low_pass = ButterworthFilter(10.0, 1000.0)
    assert low_pass.push_stamped(3.0, 5) == 3.0
    # at rest the output stays: b0 + b1 + b2 = 1 + a1 + a2 to rounding
    assert low_pass.push_stamped(3.0, 6) == pytest.approx(3.0, abs=1e-12)


def test_stamps_are_followed_across_the_wrap_of_32_bits():
    wrapping, plain = ButterworthFilter(10.0, 1000.0), ButterworthFilter(10.0, 1000.0)
    for i, value in enumerate((1.0, 2.0, 3.0, 4.0)):
        wrapping.push_stamped(value, (2**32 - 4 + 2 * i) % 2**32)
        plain.push_stamped(value, 10 + 2 * i)
    assert wrapping.output == plain.output
    assert wrapping.violations == 0


@pytest.mark.parametrize("earlier", [1, 500])
def test_a_stamp_that_runs_back_leaves_the_output_and_is_counted(earlier):
    stamped, each_ms = ButterworthFilter(10.0, 1000.0), ButterworthFilter(10.0, 1000.0)
    stamped.push_stamped(1.0, 1000)
    assert stamped.push_stamped(9.0, 1000 - earlier) == 1.0
    assert stamped.violations == 1
    stamped.push_stamped(2.0, 1000 - earlier + 2)
    for value in (1.0, 9.0, 2.0):
        each_ms.push(value)
    assert stamped.output == each_ms.output
    assert stamped.violations == 1


@pytest.mark.parametrize("gap", [101, 2000, 2001, 100_000])
def test_a_gap_of_any_length_is_filled_with_the_old_value(gap):
    stamped, each_ms = ButterworthFilter(10.0, 1000.0), ButterworthFilter(10.0, 1000.0)
    for low_pass in (stamped, each_ms):
        low_pass.push_stamped(0.0, 1000)
        low_pass.push_stamped(1.0, 1001)  # far from rest
    stamped.push_stamped(9.0, 1001 + gap)
    for _ in range(gap - 1):
        each_ms.push(1.0)
    each_ms.push(9.0)
    # a filter with poles at 0.957 forgets 2000 samples to 1e-38, but its rounding stays: a few units of 1e-16
    assert stamped.output == pytest.approx(each_ms.output, abs=1e-12)
    assert stamped.violations == 0
