# cython: boundscheck=False, wraparound=False
# (`count` stays below `capacity`: a full buffer grows first)
"""Stamped edges and stamped bytes that leave a sensor during one step of the plant.

The plant writes a step's edges, the chip on whose pins they arrive reads them one by one at their stamps, and both hold
the same buffer: edges are the most frequent events on the robot, and never become messages.
"""

from typing import Annotated

import cython

from ranger_sim.foundation.numbers import integers


@cython.final
@cython.cclass
class EdgeBuffer:
    """Edges of channel A: `packed`, each time (ns) x 4 + the level that A takes x 2 + the level of B then. `count` are
    valid, of which the first `read` have been taken.

    It grows when it is full, so no edge is ever lost; `clear` keeps the storage.
    """

    count: cython.longlong
    read: cython.longlong
    packed: cython.p_longlong
    capacity: cython.longlong
    kept: Annotated[cython.longlong[::1], "readonly"]

    def __init__(self, capacity=64) -> None:
        self.capacity = capacity
        self.count = 0
        self.read = 0
        self._keep(integers(capacity))

    @cython.ccall
    def _keep(self, storage) -> None:
        """Hold the array `storage` as `kept`, and its address as `packed`, in the cache line of the other fields."""
        self.kept = storage
        if cython.compiled:
            self.packed = cython.address(self.kept[0])
        else:
            self.packed = storage

    @cython.ccall
    def clear(self) -> cython.void:
        """Forget the edges."""
        self.count = 0
        self.read = 0

    @cython.ccall
    def grow(self) -> None:
        """Double the storage, keeping its content."""
        old = self.kept
        grown = integers(2 * self.capacity)
        for place in range(self.capacity):
            grown[place] = old[place]
        self.capacity = 2 * self.capacity
        self._keep(grown)

    @cython.ccall
    def push(self, time: cython.longlong, level_a: cython.longlong, level_b: cython.longlong) -> cython.void:
        """Add an edge; the caller keeps the order of time."""
        if self.count == self.capacity:
            self.grow()
        self.packed[self.count] = time << 2 | level_a << 1 | level_b
        self.count += 1

    def edge(self, place):
        """Edge number `place` as (time, level of A, level of B)."""
        packed = self.kept[place]
        return packed >> 2, packed >> 1 & 1, packed & 1


@cython.final
@cython.cclass
class ByteBuffer:
    """Bytes on a serial line: `times` (ns, end of the stop bit) and `values` (0 ... 255). `count` are valid."""

    capacity: cython.longlong
    count: cython.longlong
    times: cython.longlong[::1]
    values: cython.longlong[::1]

    def __init__(self, capacity=128) -> None:
        self.capacity = capacity
        self.count = 0
        self.times = integers(capacity)
        self.values = integers(capacity)

    @cython.ccall
    def clear(self) -> cython.void:
        """Forget the bytes."""
        self.count = 0

    @cython.ccall
    def grow(self) -> None:
        """Double the storage, keeping its content."""
        self.capacity = 2 * self.capacity
        for name in ("times", "values"):
            old = getattr(self, name)
            grown = integers(self.capacity)
            for place in range(len(old)):
                grown[place] = old[place]
            setattr(self, name, grown)

    @cython.ccall
    def push(self, time: cython.longlong, value: cython.longlong) -> cython.void:
        """Add a byte; the caller keeps the order of time."""
        if self.count == self.capacity:
            self.grow()
        self.times[self.count] = time
        self.values[self.count] = value
        self.count += 1
