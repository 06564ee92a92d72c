# cython: boundscheck=False, wraparound=False, initializedcheck=False
# (every index below lies between the head and the tail of the rows, or is the place of an object that is kept)
"""Stamped messages: all that passes between a board and the rest of the world.

A message is (time, order, kind, six integers, one object). Time is virtual, in ns since the robot's
power-up. Messages leave a queue sorted by (time, order, arrival); `order` is stage * 256 + source, so simultaneous
events have a written order: plant, pins, bus, interrupts, slots (`STAGE_*`). The same messages are used within one
process and between several.
"""

from typing import Annotated, Final

import cython

from ranger_sim.foundation.numbers import integers

NEVER: Final = 1 << 62  # ns; later than any time in a run (146 years)

STAGE_PLANT: Final = 0
STAGE_PINS: Final = 1
STAGE_BUS: Final = 2
STAGE_INTERRUPTS: Final = 3
STAGE_SLOTS: Final = 4
# the `order` of the first source of a stage
ORDER_PINS: Final = 256
ORDER_BUS: Final = 512
ORDER_INTERRUPTS: Final = 768

# Messages to a board (inputs).
PIN_EDGE: Final = 1  # a pin, b level 0/1, c partner pin (or -1), d level of the partner
CAN_RX: Final = 2  # a controller 1..4, b identifier, c flags, d word 0 (bytes 0-3), e word 1 (bytes 4-7)
CAN_TX_DONE: Final = 3  # a controller, b buffer 1..3, c TX_* status
CAN_STATUS: Final = 4  # a controller, b interrupt bits, c transmit errors, d receive errors, e bus-off 0/1
UART_BYTE: Final = 5  # a UART number, b byte; or c 2-8 bytes at once, d the first four, e the rest, low byte first
SSP_SEGMENT: Final = 6  # a 0, ref SspSegment received

# Messages from a board (outputs).
CAN_REQUEST: Final = 32  # a controller, b buffer 1..3, c identifier, d flags, e word 0, f word 1
CAN_ABORT: Final = 33  # a controller, b buffer
CAN_MODE: Final = 34  # a controller, b 0 operating / 1 reset
PWM_UPDATE: Final = 35  # a MR2, b MR6, c MR0 (counts)
PIN_OUTPUT: Final = 36  # a pin, b level
SSP_START: Final = 37  # a 0, ref SspSegment sent by the master; the exchange starts at the stamp
SSP_LOAD: Final = 38  # a 0, ref SspSegment that the slave will send in the next exchange
UART_OUTPUT: Final = 39  # a UART number, b byte; the stamp is the end of its last bit
CAN_FILTER: Final = 40  # a controller, b 0 every frame / 1 those of ref: bytes of `can_bus.acceptance`

# Flags of a frame: bits 0-3 data length code, then:
FLAG_REMOTE: Final = 16
FLAG_SINGLE_SHOT: Final = 32
FLAG_EXTENDED: Final = 64
FLAG_ERROR: Final = 128
# of a CAN FD frame (ISO 11898-1:2015)
FLAG_FD: Final = 256  # FDF recessive: up to 64 bytes, length codes 9-15
FLAG_BRS: Final = 512  # bit rate switch: the data phase at the data bit rate
FLAG_ESI: Final = 1024  # error state indicator: its sender was error passive

# Status of CAN_TX_DONE.
TX_SENT: Final = 0
TX_ABORTED: Final = 1  # aborted on request before it started
TX_LOST: Final = 2  # single shot that lost arbitration or met an error

ROW: Final = 10  # numbers in a row of a queue
ROW_KIND: Final = 2  # index of the kind in it


@cython.cclass
class Outbox:
    """Receiver of a board's stamped messages: a queue, or the wires of the robot, which forward them at once."""

    @cython.ccall
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
    ) -> None:
        """Take a message: its stamp (ns), `order`, kind, six integers, and an object where the kind has one."""

    @cython.ccall
    def request(
        self,
        time: cython.longlong,
        controller: cython.longlong,
        buffer: cython.longlong,
        identifier: cython.longlong,
        flags: cython.longlong,
        lo: cython.longlong,
        hi: cython.longlong,
    ) -> None:
        """Take a CAN_REQUEST."""
        self.push(time, 0, CAN_REQUEST, controller, buffer, identifier, flags, lo, hi)


@cython.final
@cython.cclass
class EventQueue(Outbox):
    """Messages sorted by (time, order, arrival), as rows that follow each other in one array.

    A new message mostly belongs at the end; otherwise those after it move up by one row. `take` moves the first message
    into the fields `time, order, kind, a ... f, ref` of the queue itself.
    """

    # fields used by every message
    head: cython.longlong
    tail: cython.longlong
    head_time: cython.longlong
    size: cython.longlong
    rows: cython.p_longlong
    place: cython.longlong
    pushed: cython.longlong
    arrival: cython.p_longlong
    ref: object
    time: cython.longlong
    order: cython.longlong
    kind: cython.longlong
    a: cython.longlong
    b: cython.longlong
    c: cython.longlong
    d: cython.longlong
    e: cython.longlong
    f: cython.longlong
    due: cython.p_longlong
    urgent_until: cython.longlong
    refs: list
    # the targets of the three addresses: kept here, replaced only by methods that also set the addresses
    rows_kept: Annotated[cython.longlong[::1], "readonly"]
    arrival_kept: Annotated[cython.longlong[::1], "readonly"]
    due_kept: Annotated[cython.longlong[::1], "readonly"]

    def __init__(self, capacity=256) -> None:
        # a row is ROW numbers: time, order, kind, a ... f, and the place in `refs` of its object (0: it has none)
        self.rows_kept = integers(ROW * capacity)
        self.size = ROW * capacity
        self.head = 0  # index at which the first row begins
        self.tail = 0  # index at which the last row ends
        self.head_time = NEVER
        self.pushed = 0
        self.refs = [None, None]
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
        self.arrival_kept = integers(1)
        self.due_kept = integers(1)
        self.place = 0
        self.urgent_until = -1
        self._find_numbers()

    @cython.cfunc
    def _find_numbers(self) -> None:
        """Set `rows`, `arrival` and `due`, through which the arrays of the same names are read and written.

        Compiled, they are addresses: three fit in one cache line, where a memoryview takes 208 bytes.
        """
        if cython.compiled:
            self.rows = cython.address(self.rows_kept[0])
            self.arrival = cython.address(self.arrival_kept[0])
            self.due = cython.address(self.due_kept[0])
        else:
            self.rows = self.rows_kept
            self.arrival = self.arrival_kept
            self.due = self.due_kept

    @property
    def count(self) -> int:
        """Number of messages that wait."""
        return (self.tail - self.head) // ROW

    def wake(self, arrival, due, place) -> None:
        """From now on a new first message lowers `arrival[place]` to its time (ns), and any urgent one `due[place]`."""
        self.arrival_kept = arrival
        self.due_kept = due
        self.place = place
        self._find_numbers()

    def _make_room(self) -> None:
        """Move the rows, which have reached the end of the array, to its beginning, or into one of twice the size."""
        i: cython.longlong
        used: cython.longlong = self.tail - self.head
        rows = self.rows_kept
        if 2 * used > self.size:
            self.size = 2 * self.size
            self.rows_kept = integers(self.size)
            self._find_numbers()
        for i in range(used):
            self.rows[i] = rows[self.head + i]
        self.head = 0
        self.tail = used

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
    ) -> None:
        """Add a message; among equal (time, order) it comes after those already there. It is urgent."""
        at: cython.longlong = self.put(time, order, kind, a, b, c, d, e, f)
        place: cython.longlong = 1
        if time > self.urgent_until:
            self.urgent_until = time
        if time < self.due[self.place]:
            self.due[self.place] = time
        if ref is not None:
            while self.refs[place] is not None:  # few waiting messages have an object
                place += 1
                if place == len(self.refs):
                    self.refs.append(None)
            self.refs[place] = ref
            self.rows[at + 9] = place

    @cython.ccall
    @cython.exceptval(check=False)
    def put(
        self,
        time: cython.longlong,
        order: cython.longlong,
        kind: cython.longlong,
        a: cython.longlong,
        b: cython.longlong,
        c: cython.longlong,
        d: cython.longlong,
        e: cython.longlong,
        f: cython.longlong,
    ) -> cython.longlong:
        """Like `push`, without an object, with all numbers given, and not urgent: a few instructions.

        Messages that wait for a task on most boards are not urgent: a frame, the end of a transmission, an edge, a
        byte. Returns the index at which the row begins.
        """
        at: cython.longlong
        if self.tail == self.size:
            self._make_room()
        at = self.tail
        self.tail = at + 10
        while at > self.head:
            if self.rows[at - 10] < time or (self.rows[at - 10] == time and self.rows[at - 9] <= order):
                break
            self._move_up(at)
            at -= 10
        if cython.compiled:
            self.rows[at] = time
            self.rows[at + 1] = order
            self.rows[at + 2] = kind
            self.rows[at + 3] = a
            self.rows[at + 4] = b
            self.rows[at + 5] = c
            self.rows[at + 6] = d
            self.rows[at + 7] = e
            self.rows[at + 8] = f
            self.rows[at + 9] = 0
        else:
            self.rows[at : at + 10] = (time, order, kind, a, b, c, d, e, f, 0)
        if at == self.head:
            self.head_time = time
            if time < self.arrival[self.place]:
                self.arrival[self.place] = time
        self.pushed += 1
        return at

    @cython.cfunc
    def _move_up(self, at: cython.longlong) -> cython.void:
        """Move the row that ends at `at` up by one row."""
        i: cython.longlong
        for i in range(at, at + 10):
            self.rows[i] = self.rows[i - 10]

    @cython.ccall
    @cython.exceptval(check=False)
    def take(self) -> cython.bint:
        """Move the first message into the fields of the queue; False when the queue is empty."""
        at: cython.longlong = self.head
        place: cython.longlong
        if at == self.tail:
            return False
        if cython.compiled:
            self.time = self.rows[at]
            self.order = self.rows[at + 1]
            self.kind = self.rows[at + 2]
            self.a = self.rows[at + 3]
            self.b = self.rows[at + 4]
            self.c = self.rows[at + 5]
            self.d = self.rows[at + 6]
            self.e = self.rows[at + 7]
            self.f = self.rows[at + 8]
            place = self.rows[at + 9]
        else:
            (self.time, self.order, self.kind, self.a, self.b, self.c, self.d, self.e, self.f, place) = self.rows[
                at : at + 10
            ]
        if place:
            self.ref = self.refs[place]
            self.refs[place] = None
        elif self.ref is not None:
            self.ref = None
        at += 10
        if at == self.tail:
            self.head = 0
            self.tail = 0
            self.head_time = NEVER
        else:
            self.head = at
            self.head_time = self.rows[at]
        return True

    @cython.ccall
    def clear(self) -> cython.void:
        """Forget every queued message."""
        while self.take():
            pass
