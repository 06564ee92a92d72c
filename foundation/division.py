# cython: cdivision=True
# (what is divided is not negative, and what it is divided by above 0)
"""Division of whole numbers where it is done for every frame and every slot."""

import cython


def quotient(a: cython.longlong, b: cython.longlong) -> cython.longlong:
    """floor(a / b) for a >= 0 and b > 0.

    Compiled, by doubles as far as they are exact: where a + b < 2^53 the quotient is at least 1 / b below the next
    whole number, which is more than it can be rounded. A processor divides 64-bit integers several times slower.
    """
    exact: cython.longlong = 9007199254740992  # 2^53
    if cython.compiled and a < exact - b:
        return cython.cast(cython.longlong, cython.cast(cython.double, a) / cython.cast(cython.double, b))
    return a // b
