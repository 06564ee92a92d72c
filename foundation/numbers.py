"""Numbers as on the robot's processors: float32, 32-bit words and 16.16 fixed point.

Interpreted Python has neither 32-bit floats nor wrapping integers, compiled code has both; every
rounding and every wrap therefore goes through this file, which gives the same bits either way.
"""

import array
from struct import Struct

import cython

pack_single, unpack_single = Struct("<f").pack, Struct("<f").unpack
pack_word, unpack_word = Struct("<I").pack, Struct("<I").unpack

WORD_MASK = 0xFFFFFFFF
# The same for the functions below: C variables when compiled, because Cython makes a Python object of
# every literal above 31 bits.
_MASK: cython.longlong = 4294967295
_SIGN: cython.longlong = 2147483648


def integers(count, value=0):
    """`count` whole numbers of 64 bits, all `value`, for a field that is accessed by index only.

    Compiled, an array, whose items are C numbers; interpreted, a list, because an array makes a new object at every
    access.
    """
    return array.array("q", [value]) * count if cython.compiled else [value] * count


def reals(values):
    """The numbers of `values` as doubles, for a field that is accessed by index only; see `integers`."""
    return array.array("d", values) if cython.compiled else [float(value) for value in values]


@cython.ccall
@cython.exceptval(check=False)
def float32(value: cython.double) -> cython.double:
    """`value` rounded to the nearest IEEE single; beyond the largest single it becomes infinite."""
    if cython.compiled:
        return cython.cast(cython.double, cython.cast(cython.float, value))
    else:
        try:
            return unpack_single(pack_single(value))[0]
        except OverflowError:
            return value * float("inf")


@cython.ccall
@cython.exceptval(check=False)
def word_of_float(value: cython.double) -> cython.longlong:
    """The 32 bits of `value` as a single-precision float, 0 ... 2^32-1. Every NaN gives 0x7FC00000."""
    if value != value:
        return 0x7FC00000
    if cython.compiled:
        single: cython.float = cython.cast(cython.float, value)
        return cython.cast(cython.longlong, cython.cast(cython.pointer(cython.uint), cython.address(single))[0])
    else:
        try:
            return unpack_word(pack_single(value))[0]
        except OverflowError:
            return 0xFF800000 if value < 0 else 0x7F800000


@cython.ccall
@cython.exceptval(check=False)
def float_of_word(word: cython.longlong) -> cython.double:
    """The single-precision float whose 32 bits are `word` (only the low 32 bits count)."""
    if cython.compiled:
        bits: cython.uint = cython.cast(cython.uint, word & _MASK)
        return cython.cast(cython.double, cython.cast(cython.pointer(cython.float), cython.address(bits))[0])
    else:
        return unpack_single(pack_word(word & 0xFFFFFFFF))[0]


@cython.ccall
def wrap_u32(value: cython.longlong) -> cython.longlong:
    """`value` modulo 2^32, 0 ... 2^32-1."""
    return value & _MASK


@cython.ccall
@cython.exceptval(check=False)
def wrap_i32(value: cython.longlong) -> cython.longlong:
    """`value` modulo 2^32 as a signed 32-bit integer, -2^31 ... 2^31-1."""
    return ((value + _SIGN) & _MASK) - _SIGN


@cython.ccall
def word_of_i32(value: cython.longlong) -> cython.longlong:
    """The 32-bit pattern of a signed integer, 0 ... 2^32-1."""
    return value & _MASK


@cython.ccall
def elapsed_u32(now: cython.longlong, then: cython.longlong) -> cython.longlong:
    """Ticks from `then` to `now` on a counter of 32 bits that may have wrapped once."""
    return (now - then) & _MASK


@cython.ccall
@cython.exceptval(check=False)
def fixed_of_float(value: cython.double) -> cython.longlong:
    """16.16 fixed point of `value`, truncated toward zero, saturated at the 32-bit limits.

    The firmware truncates (robot.md N4); NaN becomes 0.
    """
    scaled: cython.double = value * 65536.0
    if -2147483648.0 < scaled < 2147483647.0:
        return cython.cast(cython.longlong, scaled) if cython.compiled else int(scaled)
    if scaled != scaled:
        return 0
    return 2147483647 if scaled > 0.0 else -2147483648


@cython.ccall
@cython.exceptval(check=False)
def float_of_fixed(value: cython.longlong) -> cython.double:
    """The real number of a 16.16 fixed-point value (exact)."""
    return value / 65536.0


@cython.ccall
@cython.exceptval(check=False)
def fixed_multiply(a: cython.longlong, b: cython.longlong) -> cython.longlong:
    """Product of two 16.16 numbers, floored, wrapped to 32 bits as the firmware's arithmetic does."""
    product: cython.longlong = (a * b) >> 16
    if -0x80000000 <= product <= 0x7FFFFFFF:
        return product
    return wrap_i32(product)


@cython.ccall
def divide_toward_zero(numerator: cython.longlong, denominator: cython.longlong) -> cython.longlong:
    """Integer quotient as C gives it: truncated toward zero. ZeroDivisionError for denominator 0."""
    quotient: cython.longlong
    if (numerator < 0) == (denominator < 0):
        quotient = abs(numerator) // abs(denominator)
        return quotient
    quotient = abs(numerator) // abs(denominator)
    return -quotient
