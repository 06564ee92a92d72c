"""Quotients by doubles are those of whole numbers."""

from hypothesis import given
from hypothesis import strategies as st

from foundation.division import quotient

LIMIT = 1 << 53  # from here on doubles no longer hold every whole number


def test_known_quotients():
    assert [quotient(7, 2), quotient(8, 2), quotient(0, 5), quotient(4, 5)] == [3, 4, 0, 0]


@given(st.integers(1, LIMIT), st.integers(0, LIMIT), st.integers(-3, 3))
def test_beside_every_multiple_of_the_divisor_the_quotient_is_floored(b, q, off):
    a = b * (q % (LIMIT // b + 2)) + off
    if a >= 0:
        assert quotient(a, b) == a // b


@given(st.integers(0, (1 << 63) - 1), st.integers(1, (1 << 62)))
def test_numbers_too_large_for_doubles_are_divided_as_whole_numbers(a, b):
    assert quotient(a, b) == a // b
