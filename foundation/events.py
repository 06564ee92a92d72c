# cython: boundscheck=False, wraparound=False, initializedcheck=False
# (every index below is a slot of the pool)
"""Stamped messages: everything that passes between a board and the rest of the world.

A message is (time, order, kind, six integers, one object). Time is virtual, in ns since the robot's
power-up. Messages leave a queue sorted by (time, order, arrival); `order` is stage * 256 + source, so
what happens at one instant has a written order: plant, pins, bus, interrupts, slots (`STAGE_*`).
The same messages travel in one process or between several.
"""

import array

import cython

from foundation.numbers import integers

NEVER = 1 << 62  # ns; later than any instant of a run (146 years)

STAGE_PLANT = 0
STAGE_PINS = 1
STAGE_BUS = 2
STAGE_INTERRUPTS = 3
STAGE_SLOTS = 4

# Messages to a board (inputs).
PIN_EDGE = 1  # a pin, b level 0/1, c partner pin (or -1), d level of the partner
CAN_RX = 2  # a controller 1..4, b identifier, c flags, d word 0 (bytes 0-3), e word 1 (bytes 4-7)
CAN_TX_DONE = 3  # a controller, b buffer 1..3, c TX_* status
CAN_STATUS = 4  # a controller, b interrupt bits, c transmit errors, d receive errors, e bus-off 0/1
UART_BYTE = 5  # a UART number, b byte; or c 2-8 bytes at once, d the first four, e the rest, low byte first
SSP_SEGMENT = 6  # a 0, ref SspSegment received

# Messages from a board (outputs).
CAN_REQUEST = 32  # a controller, b buffer 1..3, c identifier, d flags, e word 0, f word 1
CAN_ABORT = 33  # a controller, b buffer
CAN_MODE = 34  # a controller, b 0 operating / 1 reset
PWM_UPDATE = 35  # a MR2, b MR6, c MR0 (counts)
PIN_OUTPUT = 36  # a pin, b level
SSP_START = 37  # a 0, ref SspSegment sent by the master; the exchange starts at the stamp
SSP_LOAD = 38  # a 0, ref SspSegment that the slave will send in the next exchange
UART_OUTPUT = 39  # a UART number, b byte; the stamp is the end of its last bit

# Flags of a frame: bits 0-3 data length code, then:
FLAG_REMOTE = 1 << 4
FLAG_SINGLE_SHOT = 1 << 5
FLAG_EXTENDED = 1 << 6
FLAG_ERROR = 1 << 7

# Status of CAN_TX_DONE.
TX_SENT = 0
TX_ABORTED = 1  # aborted on request before it started
TX_LOST = 2  # single shot that lost arbitration or met an error


class EventQueue:
    """Messages sorted by (time, order, arrival): a doubly linked list in a pool of slots.

    New messages mostly belong near the end, so insertion walks back from there. `take` moves the first
    message into the fields `time, order, kind, a ... f, ref` of the queue itself.
    """

    def __init__(self, capacity=256) -> None:
        self.capacity = 0
        self.count = 0
        self.head = -1
        self.tail = -1
        self.free = -1
        self.head_time = 1 << 62
        self.pushed = 0
        # a slot is one row: time, order, kind, a ... f, next slot, previous slot, 1 if `refs` has an object
        self.rows = integers(0)
        self.refs = []
        self.time = 0
        self.order = 0
        self.kind = 0
        self.a = 0
        self.b = 0
        self.c = 0
        self.d = 0
        self.e = 0
        self.f = 0
        self.ref = None
        self.wakes = array.array("q", [0])
        self.wake_place = 0
        self._grow(capacity)

    def wake(self, wakes, place) -> None:
        """From now on a new first message lowers `wakes[place]` (an array of instants in ns) to its time."""
        self.wakes = wakes
        self.wake_place = place

    def _grow(self, capacity) -> None:
        """Enlarge the pool to `capacity` slots, keeping what is queued."""
        extra = capacity - self.capacity
        grown = integers(12 * capacity)
        i: cython.longlong
        for i in range(12 * self.capacity):
            grown[i] = self.rows[i]
        self.rows = grown
        self.refs.extend([None] * extra)
        for i in range(self.capacity, capacity):
            self.rows[12 * i + 9] = self.free
            self.free = i
        self.capacity = capacity

    def push(
        self,
        time: cython.longlong,
        order: cython.longlong,
        kind: cython.longlong,
        a: cython.longlong = 0,
        b: cython.longlong = 0,
        c: cython.longlong = 0,
        d: cython.longlong = 0,
        e: cython.longlong = 0,
        f: cython.longlong = 0,
        ref: object = None,
    ) -> cython.void:
        """Add a message; among equal (time, order) it comes after those already there."""
        slot: cython.longlong
        before: cython.longlong
        after: cython.longlong
        row: cython.longlong
        if self.free < 0:
            self._grow(self.capacity * 2)
        slot = self.free
        row = slot * 12
        self.free = self.rows[row + 9]
        before = self.tail
        while before >= 0 and self.rows[before * 12] >= time:
            if self.rows[before * 12] == time and self.rows[before * 12 + 1] <= order:
                break
            before = self.rows[before * 12 + 10]
        if before < 0:
            after = self.head
            self.head = slot
            self.head_time = time
            if time < self.wakes[self.wake_place]:
                self.wakes[self.wake_place] = time
        else:
            after = self.rows[before * 12 + 9]
            self.rows[before * 12 + 9] = slot
        if after < 0:
            self.tail = slot
        else:
            self.rows[after * 12 + 10] = slot
        self.rows[row] = time
        self.rows[row + 1] = order
        self.rows[row + 2] = kind
        self.rows[row + 3] = a
        self.rows[row + 4] = b
        self.rows[row + 5] = c
        self.rows[row + 6] = d
        self.rows[row + 7] = e
        self.rows[row + 8] = f
        self.rows[row + 9] = after
        self.rows[row + 10] = before
        self.rows[row + 11] = 0
        if ref is not None:
            self.refs[slot] = ref
            self.rows[row + 11] = 1
        self.count += 1
        self.pushed += 1

    def take(self) -> cython.bint:
        """Move the first message into the fields of the queue; False when the queue is empty."""
        slot: cython.longlong = self.head
        row: cython.longlong = slot * 12
        after: cython.longlong
        if slot < 0:
            return False
        self.time = self.rows[row]
        self.order = self.rows[row + 1]
        self.kind = self.rows[row + 2]
        self.a = self.rows[row + 3]
        self.b = self.rows[row + 4]
        self.c = self.rows[row + 5]
        self.d = self.rows[row + 6]
        self.e = self.rows[row + 7]
        self.f = self.rows[row + 8]
        if self.rows[row + 11]:
            self.ref = self.refs[slot]
            self.refs[slot] = None
        elif self.ref is not None:
            self.ref = None
        after = self.rows[row + 9]
        self.head = after
        if after < 0:
            self.tail = -1
            self.head_time = 1 << 62
        else:
            self.rows[after * 12 + 10] = -1
            self.head_time = self.rows[after * 12]
        self.rows[row + 9] = self.free
        self.free = slot
        self.count -= 1
        return True

    def clear(self) -> cython.void:
        """Forget every queued message."""
        while self.take():
            pass
