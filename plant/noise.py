# cython: boundscheck=False, wraparound=False
# (a place is twelve bits and the table has more than 4096 values)
"""Cheap normal noise for sensors that are read at every step of the plant.

A table of the 4096 quantiles of the normal distribution, scaled to variance 1 and shuffled by the seed, is
addressed by 12 random bits; one 64-bit draw serves five values (`normal`) or five places from which a row of up
to 64 neighbours is read (`block`). Largest value 3.67.
"""

import statistics

import cython

from ranger_sim.foundation.numbers import reals
from ranger_sim.foundation.random_stream import RandomStream

TABLE_SIZE = 4096
BLOCK = 64  # values that may be read from a place on


def quantile_table() -> list[float]:
    """The 4096 values: quantiles at (i + 1/2) / 4096, mean 0, variance 1."""
    normal = statistics.NormalDist()
    half = [normal.inv_cdf((i + 0.5) / TABLE_SIZE) for i in range(TABLE_SIZE // 2)]
    scale = (2.0 * sum(value * value for value in half) / TABLE_SIZE) ** -0.5
    half = [value * scale for value in half]
    return half + [-value for value in reversed(half)]


class NoiseSource:
    """Normal numbers of one named stream. `seed`: any integer; `name`: unique per source."""

    def __init__(self, seed, name) -> None:
        self.stream = RandomStream(seed, name)
        table = quantile_table()
        for i in range(TABLE_SIZE - 1, 0, -1):
            j = self.stream.integer(i + 1)
            table[i], table[j] = table[j], table[i]
        table.extend(table[:BLOCK])
        self.table = reals(table)
        self.word = 0
        self.left = 0

    def normal(self) -> cython.double:
        """The next value, mean 0, variance 1."""
        return self.table[self.block()]

    def block(self) -> cython.longlong:
        """A random place of `table` (0 ... 4095): 64 values from there on are noise of so many channels."""
        place: cython.longlong
        if self.left == 0:
            self.word = self.stream.bits() >> 4
            self.left = 5
        place = self.word & 4095
        self.word >>= 12
        self.left -= 1
        return place
