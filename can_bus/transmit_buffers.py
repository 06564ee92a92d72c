# cython: boundscheck=False, wraparound=False, initializedcheck=False
# (every index below is made from a node and a buffer, which `Bus.request` has checked, or is a row of the list)
"""The transmit buffers of all controllers on a bus, and a list of the waiting ones.

A buffer is a row of eight numbers; buffer 1 ... 3 of node n begins at n << NODE_SHIFT | buffer << BUFFER_SHIFT. The
number of that place identifies the buffer: `row`. Of equal arbitration fields the lower row is sent first: the lower
node, then the lower buffer.
"""

from typing import Annotated, Final

import cython

from ranger_sim.can_bus.fd_frame import fd_wire
from ranger_sim.can_bus.frame import wire
from ranger_sim.foundation.events import FLAG_FD, NEVER
from ranger_sim.foundation.numbers import integers

BUFFERS: Final = 3  # transmit buffers of an LPC2194 CAN controller
# columns of a row
FREE_AT: Final = 0  # time from which the buffer takes a frame, ns; NEVER while it holds one
READY: Final = 1  # bit at which its frame may start; NEVER + that bit while its node is joining
ASKED: Final = 2  # time of the request, ns
NEXT: Final = 3  # the next waiting row, -1 for none
IDENTIFIER: Final = 4
FLAGS: Final = 5
LOW: Final = 6  # data bytes 0-3
HIGH: Final = 7  # data bytes 4-7
ROW: Final = 8  # numbers in a row
ESI_REQUESTED: Final = 2048  # flag of a waiting CAN FD frame: it shows ESI whatever the state of its sender
# the parts of a row's name
BUFFER_SHIFT: Final = 3
BUFFER_MASK: Final = 3
NODE_SHIFT: Final = 5


@cython.final
@cython.cclass
class TransmitBuffers:
    """`rows`: the numbers. `first`: the first of the waiting rows, in no order, -1 for none; `waiting_count`: their
    number.

    `payloads`: by row, the data of a CAN FD frame, all bytes. `iso`: how CAN FD frames are coded (`fd_frame`).

    `rows` is accessed through `slots`: compiled, an address, in one cache line with the other fields, where a
    memoryview takes 208 bytes.
    """

    slots: cython.p_longlong
    first: cython.longlong
    waiting_count: cython.longlong
    # the array that `slots` points into: replaced only by `add_node`, which sets both
    rows: Annotated[cython.longlong[::1], "readonly"]
    payloads: dict
    iso: cython.bint

    def __init__(self) -> None:
        self.payloads = {}
        self.iso = True
        self.rows = integers(ROW)
        self.first = -1
        self.waiting_count = 0

    def add_node(self) -> None:
        """Add the buffers of one more node."""
        before = self.rows
        kept = len(before) >> NODE_SHIFT << NODE_SHIFT
        self.rows = integers(kept + (1 << NODE_SHIFT))
        for place in range(kept):
            self.rows[place] = before[place]
        self.slots = cython.address(self.rows[0]) if cython.compiled else self.rows

    # ---- the list of waiting rows

    @cython.cfunc
    def remove(self, row: cython.longlong) -> cython.void:
        """Take a row off the list."""
        before: cython.longlong = self.first
        following: cython.longlong = self.slots[row + NEXT]
        self.waiting_count -= 1
        if before == row:
            self.first = following
            return
        while self.slots[before + NEXT] != row:
            before = self.slots[before + NEXT]
        self.slots[before + NEXT] = following

    def waiting(self) -> list:
        """Rows of all nodes that wait, in no order."""
        found = []
        row = self.first
        while row >= 0:
            found.append(row)
            row = self.rows[row + NEXT]
        return found

    def waiting_of(self, node) -> list:
        """Rows of a node that wait, lowest buffer first."""
        rows = [node << NODE_SHIFT | buffer << BUFFER_SHIFT for buffer in range(1, BUFFERS + 1)]
        return [row for row in rows if self.is_full(row)]

    def is_full(self, row) -> cython.bint:
        """True while a frame waits in a buffer."""
        return self.rows[row + FREE_AT] == NEVER

    def hold(self, row, bit) -> None:
        """Let the frame in a row start no earlier than `bit`."""
        self.rows[row + READY] = max(self.rows[row + READY], bit)

    def wire(self, row) -> tuple:
        """The bits of the frame in a row and their fields."""
        if self.rows[row + FLAGS] & FLAG_FD:
            return fd_wire(self.rows[row + IDENTIFIER], self.rows[row + FLAGS], self.payloads[row], self.iso)
        return wire(self.rows[row + IDENTIFIER], self.rows[row + FLAGS], self.rows[row + LOW], self.rows[row + HIGH])

    @cython.cfunc
    @cython.exceptval(check=False)
    def first_ready(self) -> cython.longlong:
        """The first bit at which a frame may start; NEVER or later when none may."""
        first: cython.longlong = NEVER
        row: cython.longlong = self.first
        while row >= 0:
            if self.slots[row + READY] < first:
                first = self.slots[row + READY]
            row = self.slots[row + NEXT]
        return first
