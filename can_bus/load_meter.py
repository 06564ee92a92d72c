# cython: boundscheck=False, wraparound=False, initializedcheck=False
# (every index below is a place of the ring)
"""Load of a bus: overall, and in windows of 10 ms. All counts are bits since power-up, of a CAN FD bus its ticks."""

import array
from typing import Final

import cython

WINDOWS_KEPT: Final = 1024  # closed windows, 10.24 s

WINDOWS_PER_SECOND = 100


@cython.final
@cython.cclass
class LoadMeter:
    """Counts the bits for which a bus is busy: stuff bits, intermission and error frames included.

    `bits`: busy bits since `start`; `data_bits`: the part of them at the data rate of CAN FD. `count`: windows closed
    since then. `window_busy`: bits of the open window.
    """

    bits: cython.longlong
    data_bits: cython.longlong
    window_busy: cython.longlong
    window_end: cython.longlong
    taken_until: cython.longlong
    origin_bit: cython.longlong
    window_bits: cython.longlong
    busiest: cython.longlong
    count: cython.longlong
    ring: cython.longlong[::1]

    def __init__(self, bitrate) -> None:
        self.window_bits = max(bitrate // WINDOWS_PER_SECOND, 1)
        self.taken_until = 0
        self.start(0)

    def start(self, bit) -> None:
        """Restart the count from `bit` on."""
        self.bits = 0
        self.data_bits = 0
        self.origin_bit = bit
        self.window_end = bit + self.window_bits
        self.window_busy = 0
        self.busiest = 0
        self.count = 0
        self.ring = array.array("q", [0]) * WINDOWS_KEPT

    @cython.cfunc
    def take(self, first: cython.longlong, free: cython.longlong) -> cython.void:
        """Count the bus as busy from bit `first` until it is free at bit `free`."""
        self.bits += free - first
        self.taken_until = free
        if free > self.window_end:
            self._split(first, free)
        else:
            self.window_busy += free - first

    @cython.cfunc
    def _split(self, first: cython.longlong, last: cython.longlong) -> cython.void:
        """Count bits `first` ... `last` - 1, which reach beyond the open window, as busy."""
        if first >= self.window_end:
            self._roll(first)
        while last > self.window_end:
            self.window_busy += self.window_end - first
            first = self.window_end
            self._roll(first)
        self.window_busy += last - first

    @cython.cfunc
    def _roll(self, bit: cython.longlong) -> cython.void:
        """Close windows until `bit` lies in the open one."""
        idle: cython.longlong
        if self.window_busy > self.busiest:
            self.busiest = self.window_busy
        while bit >= self.window_end:
            self.ring[self.count % WINDOWS_KEPT] = self.window_busy
            self.count += 1
            self.window_busy = 0
            self.window_end += self.window_bits
            idle = (bit - self.window_end) // self.window_bits - WINDOWS_KEPT
            if idle > 0:  # a ring full of idle windows is enough
                self.count += idle
                self.window_end += idle * self.window_bits

    def mean(self, bit) -> float:
        """Share of the bits from the start to `bit` for which the bus was busy, 0 ... 1."""
        if bit <= self.origin_bit:
            return 0.0
        ahead = max(self.taken_until - bit, 0) if self.bits else 0  # part of a frame decided but not over
        return max(self.bits - ahead, 0) / (bit - self.origin_bit)

    def data_share(self) -> float:
        """Share of the busy time for which frames were at the data rate of CAN FD, 0 ... 1; 0 before any frame."""
        return self.data_bits / self.bits if self.bits else 0.0

    def largest(self) -> float:
        """Load of the fullest window (the open one counts with what it has), 0 ... 1."""
        return max(self.busiest, self.window_busy) / self.window_bits

    def windows(self) -> list:
        """Loads of the closed windows still kept (the last WINDOWS_KEPT), oldest first, 0 ... 1."""
        kept = min(self.count, WINDOWS_KEPT)
        return [self.ring[i % WINDOWS_KEPT] / self.window_bits for i in range(self.count - kept, self.count)]
