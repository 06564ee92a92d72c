"""Seeded random numbers: one named stream per noise source, the same in every mode and process.

Generator: SplitMix64 (Steele, Lea and Flood, 2014): a 64-bit counter with an avalanche function, so a
stream is one integer of state and two streams differ as soon as their names or seeds do.
"""

import cython
from cython.cimports.libc.math import log, sqrt

_MASK = 0xFFFFFFFFFFFFFFFF


def stream_key(seed: int, name: str) -> int:
    """64-bit start value of a stream: FNV-1a over the name, mixed with the seed (any Python int)."""
    key = 0xCBF29CE484222325
    for byte in f"{seed}/{name}".encode():
        key = ((key ^ byte) * 0x100000001B3) & _MASK
    return key


@cython.cclass
class RandomStream:
    """Random numbers of one noise source. `seed`: any integer; `name`: unique per source."""

    name: str
    state: cython.ulonglong
    increment: cython.ulonglong
    multiplier_1: cython.ulonglong
    multiplier_2: cython.ulonglong
    spare: cython.double
    has_spare: cython.bint

    def __init__(self, seed, name) -> None:
        self.name = name
        self.state = stream_key(seed, name)
        self.increment = 0x9E3779B97F4A7C15
        self.multiplier_1 = 0xBF58476D1CE4E5B9
        self.multiplier_2 = 0x94D049BB133111EB
        self.spare = 0.0
        self.has_spare = False

    @cython.ccall
    def bits(self) -> cython.ulonglong:
        """The next 64 random bits."""
        z: cython.ulonglong
        if cython.compiled:
            # an unsigned C word wraps automatically; literals above 63 bits would be Python objects here
            self.state += self.increment
            z = self.state
            z = (z ^ (z >> 30)) * self.multiplier_1
            z = (z ^ (z >> 27)) * self.multiplier_2
        else:
            self.state = (self.state + self.increment) & 0xFFFFFFFFFFFFFFFF
            z = self.state
            z = ((z ^ (z >> 30)) * self.multiplier_1) & 0xFFFFFFFFFFFFFFFF
            z = ((z ^ (z >> 27)) * self.multiplier_2) & 0xFFFFFFFFFFFFFFFF
        return z ^ (z >> 31)

    @cython.ccall
    def uniform(self) -> cython.double:
        """Uniform in [0, 1), a multiple of 2^-53."""
        return (self.bits() >> 11) * (1.0 / 9007199254740992.0)

    @cython.ccall
    def integer(self, n: cython.longlong) -> cython.longlong:
        """Uniform in 0 ... n-1 for n below 2^53."""
        scaled: cython.double = self.uniform() * n
        return cython.cast(cython.longlong, scaled) if cython.compiled else int(scaled)

    @cython.ccall
    def normal(self) -> cython.double:
        """Standard normal (Marsaglia's polar method, two values per round)."""
        u: cython.double
        v: cython.double
        s: cython.double
        factor: cython.double
        if self.has_spare:
            self.has_spare = False
            return self.spare
        while True:
            u = 2.0 * self.uniform() - 1.0
            v = 2.0 * self.uniform() - 1.0
            s = u * u + v * v
            if 0.0 < s < 1.0:
                break
        factor = sqrt(-2.0 * log(s) / s)
        self.spare = v * factor
        self.has_spare = True
        return u * factor
