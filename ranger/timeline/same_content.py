# cython: boundscheck=False, wraparound=False
# (every index below is that of a row, or masked to the length of the table)
"""Finds frames again by their content."""

import cython

from ranger_sim.foundation.numbers import integers


@cython.ccall
def first_same(
    wanted: cython.longlong[::1],
    wanted_ns: cython.longlong[::1],
    offered: cython.longlong[::1],
    offered_ns: cython.longlong[::1],
    found: cython.longlong[::1],
) -> None:
    """Fill `found` with the first row of `offered` of the same three numbers that is not earlier, for each of `wanted`.

    -1 where no row is. Both are in order of time (ns).
    """
    row: cython.longlong
    place: cython.longlong
    other: cython.longlong
    size: cython.longlong = 1
    while size < 2 * len(offered_ns):
        size *= 2
    # of each place of the table the first of its rows, of each row the next of the same place: in order of time
    first: cython.longlong[::1] = integers(size, -1)
    after: cython.longlong[::1] = integers(len(offered_ns) + 1, -1)
    for row in range(len(offered_ns) - 1, -1, -1):
        place = table_place(offered[3 * row], offered[3 * row + 1], offered[3 * row + 2], size)
        after[row] = first[place]
        first[place] = row
    for row in range(len(wanted_ns)):
        place = table_place(wanted[3 * row], wanted[3 * row + 1], wanted[3 * row + 2], size)
        other = first[place]
        while other >= 0 and offered_ns[other] < wanted_ns[row]:
            other = after[other]
        first[place] = other  # the earlier ones are earlier than all that is still wanted
        while other >= 0 and not (
            offered[3 * other] == wanted[3 * row]
            and offered[3 * other + 1] == wanted[3 * row + 1]
            and offered[3 * other + 2] == wanted[3 * row + 2]
        ):
            other = after[other]
        found[row] = other


@cython.cfunc
@cython.exceptval(check=False)
def table_place(
    one: cython.longlong, two: cython.longlong, three: cython.longlong, size: cython.longlong
) -> cython.longlong:
    """Where these three numbers are in a table of `size` (a power of two)."""
    mixed: cython.ulonglong = one & 0x1FFFFFFF
    mixed = mixed * 31 + (two & 0x7FFFFFFF)
    mixed = mixed * 31 + (three & 0x7FFFFFFF)
    mixed = (mixed & 0x7FFFFFFF) * 0x1E3779B1  # larger numbers would be objects of Python, and go over 64 bits
    return (mixed >> 24 ^ mixed) & (size - 1)
