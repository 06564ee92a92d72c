"""The smoothed sign of friction against the hyperbolic tangent of the library."""

import math

import pytest

from ranger_sim.plant.mechanics.friction import smoothed_sign

RATES = [k / 128 for k in range(-3000, 3001)] + [s * 10.0**k for s in (-1, 1) for k in range(-300, 301, 7)]


def test_it_is_the_hyperbolic_tangent_to_its_last_bits():
    assert max(abs(smoothed_sign(x) - math.tanh(x)) for x in RATES) <= 4e-16


def test_it_is_odd_and_grows_from_minus_one_to_one():
    assert smoothed_sign(0.0) == 0.0
    assert all(abs(smoothed_sign(x) + smoothed_sign(-x)) <= 4e-16 for x in RATES)
    values = [smoothed_sign(x) for x in sorted(RATES)]
    assert all(later - earlier >= -4e-16 for earlier, later in zip(values, values[1:], strict=False))
    assert all(-1.0 <= value <= 1.0 for value in values)


@pytest.mark.parametrize("x", [20.0, 354.0, 1e3, 1e308, math.inf])
def test_far_from_rest_it_is_the_sign_itself_and_never_overflows(x):
    assert smoothed_sign(x) == 1.0
    assert smoothed_sign(-x) == -1.0


def test_what_is_not_a_number_is_not_hidden():
    assert math.isnan(smoothed_sign(math.nan))
