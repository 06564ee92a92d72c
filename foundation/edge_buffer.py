# cython: boundscheck=False, wraparound=False
# (`count` stays below `capacity`: a full buffer grows first)
"""Stamped edges and stamped bytes that leave a sensor during one step of the plant.

The plant writes a step's edges, the chip on whose pins they arrive reads them one by one at their stamps, and both
hold the same buffer: an edge is the most frequent thing on the robot, and never becomes a message.
"""

import cython

from foundation.numbers import integers


class EdgeBuffer:
    """Edges of channel A: `times` (ns), the level that A takes, the level of B then. `count` are valid, of which the
    first `read` have been taken.

    It grows when it is full, so no edge is ever lost; `clear` keeps the storage.
    """

    def __init__(self, capacity=64) -> None:
        self.capacity = capacity
        self.count = 0
        self.read = 0
        self.times = integers(capacity)
        self.levels_a = integers(capacity)
        self.levels_b = integers(capacity)

    def clear(self) -> cython.void:
        """Forget the edges."""
        self.count = 0
        self.read = 0

    def grow(self) -> None:
        """Double the storage, keeping what is there."""
        self.capacity = 2 * self.capacity
        for name in ("times", "levels_a", "levels_b"):
            old = getattr(self, name)
            grown = integers(self.capacity)
            for place in range(len(old)):
                grown[place] = old[place]
            setattr(self, name, grown)

    def push(self, time: cython.longlong, level_a: cython.longlong, level_b: cython.longlong) -> cython.void:
        """Add an edge; the caller keeps the order of time."""
        if self.count == self.capacity:
            self.grow()
        self.times[self.count] = time
        self.levels_a[self.count] = level_a
        self.levels_b[self.count] = level_b
        self.count += 1


class ByteBuffer:
    """Bytes on a serial line: `times` (ns, end of the stop bit) and `values` (0 ... 255). `count` are valid."""

    def __init__(self, capacity=128) -> None:
        self.capacity = capacity
        self.count = 0
        self.times = integers(capacity)
        self.values = integers(capacity)

    def clear(self) -> cython.void:
        """Forget the bytes."""
        self.count = 0

    def grow(self) -> None:
        """Double the storage, keeping what is there."""
        self.capacity = 2 * self.capacity
        for name in ("times", "values"):
            old = getattr(self, name)
            grown = integers(self.capacity)
            for place in range(len(old)):
                grown[place] = old[place]
            setattr(self, name, grown)

    def push(self, time: cython.longlong, value: cython.longlong) -> cython.void:
        """Add a byte; the caller keeps the order of time."""
        if self.count == self.capacity:
            self.grow()
        self.times[self.count] = time
        self.values[self.count] = value
        self.count += 1
