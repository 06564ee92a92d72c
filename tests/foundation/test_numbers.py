"""Known answers of the number helpers, then properties against independent arithmetic."""

import ctypes
import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ranger_sim.foundation import numbers

WORDS = st.integers(min_value=0, max_value=2**32 - 1)
SINGLES = st.floats(width=32, allow_nan=False)


@pytest.mark.parametrize(
    ("value", "word"),
    [(0.0, 0), (1.0, 0x3F800000), (-1.5, 0xBFC00000), (0.1, 0x3DCCCCCD), (math.inf, 0x7F800000)],
)
def test_known_singles_have_their_ieee_words(value, word):
    assert numbers.word_of_float(value) == word


def test_a_double_too_large_for_a_single_becomes_infinite():
    assert numbers.float32(1e300) == math.inf
    assert numbers.word_of_float(-1e300) == 0xFF800000


def test_float32_rounds_to_the_nearest_single():
    assert numbers.float32(0.1) == 0.10000000149011612


@given(SINGLES)
def test_every_single_survives_its_word(value):
    assert numbers.float_of_word(numbers.word_of_float(value)) == value


@given(st.floats(allow_nan=False, min_value=-3e38, max_value=3e38))
def test_float32_agrees_with_the_struct_module(value):
    assert numbers.float32(value) == struct.unpack("<f", struct.pack("<f", value))[0]


@given(st.integers(min_value=-(2**62), max_value=2**62))
def test_wraps_agree_with_c_integers(value):
    assert numbers.wrap_u32(value) == ctypes.c_uint32(value).value
    assert numbers.wrap_i32(value) == ctypes.c_int32(value).value
    assert numbers.word_of_i32(value) == ctypes.c_uint32(value).value


def test_elapsed_time_crosses_the_wrap_of_the_counter():
    assert numbers.elapsed_u32(5, 2**32 - 3) == 8


@pytest.mark.parametrize(
    ("value", "fixed"),
    [
        (1.0, 65536),
        (-1.0, -65536),
        (1e-5, 0),
        (-1e-5, 0),
        (1.99999, 131071),
        (-1.99999, -131071),
        (1e9, 2**31 - 1),
        (-1e9, -(2**31)),
        (math.nan, 0),
    ],
)
def test_fixed_point_truncates_toward_zero_and_saturates(value, fixed):
    assert numbers.fixed_of_float(value) == fixed


def test_fixed_products_are_floored():
    assert numbers.fixed_multiply(-1, 1) == -1  # -2^-32 floors to the next fixed value below zero
    assert numbers.fixed_multiply(3 << 16, -(2 << 16)) == -(6 << 16)


@given(st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31), 2**31 - 1))
def test_fixed_products_wrap_as_32_bit_words_do(a, b):
    assert numbers.fixed_multiply(a, b) == ctypes.c_int32((a * b) >> 16).value


@given(st.integers(-(2**40), 2**40), st.integers(-(2**20), 2**20).filter(bool))
def test_division_truncates_toward_zero_as_c_does(a, b):
    exact = abs(a) // abs(b)
    assert numbers.divide_toward_zero(a, b) == (exact if (a < 0) == (b < 0) else -exact)


def test_every_nan_has_the_same_word():
    for word in (0x7FC00000, 0xFFC00000, 0x7FC12345, 0xFFFFFFFF, 0x7F800001):
        assert numbers.word_of_float(numbers.float_of_word(word)) == 0x7FC00000
