# cython: boundscheck=False, wraparound=False, initializedcheck=False
# (every index below is a place of a ring of whole rows)
"""What a board's processor did, row by row: every task, wait, interrupt and slot, as it ran.

A log is attached to a board (`Microcontroller.keep_activity`), and its processor writes into it; without a log it
writes nothing and loses no time. The robot behaves the same with and without a log.

**A row** is ACTIVITY_COLUMNS whole numbers of 64 bits:

    COLUMN_KIND     one of the kinds below
    COLUMN_NUMBER   of the task (`Legend.tasks`), of the interrupt (`Legend.interrupts`), or of the slot (1: the first)
    COLUMN_START    time (ns) at which it had the processor for the first time
    COLUMN_END      time (ns) at which its code was through
    COLUMN_CYCLES   what it cost itself, without what interrupted it; of a slot: from its tick to its end, all in all
    COLUMN_LATENCY  of an interrupt: ns from its request to the first instruction of its handler; otherwise 0
    COLUMN_ROW      row of the schedule to which it belongs; of an interrupt: the one that ran
    COLUMN_ITEMS    items that were handled; each kind below that means something else by it says so

    TASK_RAN        a task of the schedule
    WAIT_RAN        a task that spins; items: cycles for which it span
    INTERRUPT_RAN   a service; cycles and start include the processor's way to the handler (the source's `latency`)
    MAIN_LOOP_RAN   the main loop outside the scheduler was at work, as the router's; its number is 0. Turns that follow
                    each other without a gap are one row, so that it does not matter in which steps time passes
    SLOT_BEGAN      start and end: the timer's match; items: tasks that the slot is to run
    SLOT_ENDED      start: the match; end: the last task is through, the one running at an overrun too; items: 1 if so
    SLOT_OVERRAN    a tick found the slot unfinished; start: the match of that slot; end: that tick's; items: tasks
                    that were dropped
    TASK_DROPPED    one of them; start and end: that tick's match

**How rows nest.** Between start and end of a row lie those that interrupted it: an interrupt's in a task's or in
another interrupt's (a FIQ's in an IRQ's), never two that overlap partly. So the innermost row around a time is the one
that had the processor then. `end - start` of a row less the cycles of the rows inside is its own cycles, but for the
rounding: each time is whole nanoseconds, rounded down. An entry of an occasional list has a row inside its list's row,
with the same start and end; the cycles of the list are those of choosing.
A slot that was dropped as a whole has a SLOT_BEGAN and a SLOT_OVERRAN, and no SLOT_ENDED; one in which the processor
stopped has only a SLOT_BEGAN, and a processor that begins anew counts its slots from 1 again. What is not through yet
(a task, an interrupt) has no row yet: rows come in the order in which their ends become known, an inner one before
its outer one.

**How to read it.** `newest()`: the rows that are kept, the oldest first, in one flat array. `sinks`: each is called as
`sink(time_ns, rows)`, rows as bytes, a part of the ring at a time and at `flush()`; it gets every row written since it
was added to the list, once.
"""

import array
from typing import Final

import cython

from ranger_sim.foundation.row_stream import RowStream

TASK_RAN: Final = 1
WAIT_RAN: Final = 2
INTERRUPT_RAN: Final = 3
MAIN_LOOP_RAN: Final = 4
SLOT_BEGAN: Final = 5
SLOT_ENDED: Final = 6
SLOT_OVERRAN: Final = 7
TASK_DROPPED: Final = 8
COLUMN_KIND: Final = 0
COLUMN_NUMBER: Final = 1
COLUMN_START: Final = 2
COLUMN_END: Final = 3
COLUMN_CYCLES: Final = 4
COLUMN_LATENCY: Final = 5
COLUMN_ROW: Final = 6
COLUMN_ITEMS: Final = 7
ACTIVITY_COLUMNS: Final = 8

# 2 MiB: about half a second of a motor board that walks (56 rows a millisecond)
USUAL_ROWS = 32_768
# 64 KiB: still in the processor's cache, and the C library uses the memory of a dropped part again
PART: Final = 1024 * ACTIVITY_COLUMNS


@cython.final
@cython.cclass
class ActivityLog(RowStream):
    """The newest `rows` rows in a ring; `sinks` get all of them. `laps`: how often the ring was full.

    `keep_ns`: where the board moves into a separate process, how much is kept there until a reader asks (0: as much as
    fits).

    What runs is open until its end is known: the task (with its occasional list) or turn of the main loop in `code_*`
    and `list_*`, the IRQ in `irq_*`. A FIQ cannot be interrupted, so its end is known at once.
    """

    sinks: list
    handed: cython.longlong
    due: cython.longlong
    laps: cython.longlong
    keep_ns: cython.longlong
    code_open: cython.bint
    list_open: cython.bint
    irq_open: cython.bint
    code_kind: cython.longlong
    code_number: cython.longlong
    code_start: cython.longlong
    code_cycles: cython.longlong
    code_row: cython.longlong
    code_items: cython.longlong
    list_number: cython.longlong
    list_cycles: cython.longlong
    irq_number: cython.longlong
    irq_start: cython.longlong
    irq_cycles: cython.longlong
    irq_latency: cython.longlong
    irq_row: cython.longlong
    irq_items: cython.longlong

    def __init__(self, rows=USUAL_ROWS) -> None:
        RowStream.__init__(self, "q", ACTIVITY_COLUMNS, False, block_rows=rows)
        self.sinks = []
        self.handed = 0  # up to here (a place in the ring) the sinks have everything
        self.due = min(PART, self.capacity)  # and from here on they get the rest
        self.laps = 0
        self.keep_ns = 0
        self.code_open = False
        self.code_kind = 0
        self.code_number = 0
        self.code_start = 0
        self.code_cycles = 0
        self.code_row = 0
        self.code_items = 0
        self.list_open = False
        self.list_number = 0
        self.list_cycles = 0
        self.irq_open = False
        self.irq_number = 0
        self.irq_start = 0
        self.irq_cycles = 0
        self.irq_latency = 0
        self.irq_row = 0
        self.irq_items = 0

    # --- reading ------------------------------------------------------------------------------------------

    def add_sink(self, sink) -> None:
        """Call `sink(time_ns, rows)` with the rows from here on."""
        self.flush()
        self.sinks.append(sink)

    def flush(self) -> None:
        """Hand over what the sinks do not have yet; start at the ring's begin again when it is full."""
        if self.handed < self.used and self.sinks:
            block: object = memoryview(self.integers)
            rows = block[self.handed : self.used].tobytes()
            for sink in self.sinks:
                sink(self.last_time_ns, rows)
        self.handed = self.used
        if self.used == self.capacity:
            self.used = 0
            self.handed = 0
            self.laps += 1
        self.due = min(self.used + PART, self.capacity)

    @property
    def written(self) -> int:
        """Rows since the log was made."""
        return (self.laps * self.capacity + self.used) // ACTIVITY_COLUMNS

    def newest(self) -> array.array:
        """The rows that are kept, the oldest first: ACTIVITY_COLUMNS numbers each, one after another."""
        ring: object = memoryview(self.integers)
        rows = array.array("q", ring[: self.used].tobytes())
        if self.laps:
            rows = array.array("q", ring[self.used :].tobytes()) + rows
        return rows

    # --- writing ------------------------------------------------------------------------------------------

    @cython.ccall
    def put(
        self,
        kind: cython.longlong,
        number: cython.longlong,
        start: cython.longlong,
        end: cython.longlong,
        cycles: cython.longlong,
        latency: cython.longlong,
        row: cython.longlong,
        items: cython.longlong,
    ) -> None:
        """Write one row."""
        at: cython.longlong = self.used
        self.numbers[at] = kind
        self.numbers[at + COLUMN_NUMBER] = number
        self.numbers[at + COLUMN_START] = start
        self.numbers[at + COLUMN_END] = end
        self.numbers[at + COLUMN_CYCLES] = cycles
        self.numbers[at + COLUMN_LATENCY] = latency
        self.numbers[at + COLUMN_ROW] = row
        self.numbers[at + COLUMN_ITEMS] = items
        self.used = at + ACTIVITY_COLUMNS
        self.last_time_ns = end
        if self.used >= self.due:
            self.flush()

    @cython.ccall
    def begin_code(
        self,
        kind: cython.longlong,
        number: cython.longlong,
        start: cython.longlong,
        cycles: cython.longlong,
        row: cython.longlong,
        items: cython.longlong,
    ) -> None:
        """A task, wait or turn of the main loop has the processor. While a task is open: the entry of that list."""
        if self.code_open:
            self.list_open = True
            self.list_number = self.code_number
            self.list_cycles = self.code_cycles
        else:
            self.code_start = start
        self.code_open = True
        self.code_kind = kind
        self.code_number = number
        self.code_cycles = cycles
        self.code_row = row
        self.code_items = items

    @cython.ccall
    def end_code(self, time: cython.longlong) -> None:
        """The code that is open, if any, was through at `time` (ns)."""
        if self.code_open:
            self.code_open = False
            self.put(
                self.code_kind,
                self.code_number,
                self.code_start,
                time,
                self.code_cycles,
                0,
                self.code_row,
                self.code_items,
            )
            if self.list_open:
                self.list_open = False
                self.put(TASK_RAN, self.list_number, self.code_start, time, self.list_cycles, 0, self.code_row, 0)

    @cython.ccall
    def begin_irq(
        self,
        number: cython.longlong,
        start: cython.longlong,
        cycles: cython.longlong,
        latency: cython.longlong,
        row: cython.longlong,
        items: cython.longlong,
    ) -> None:
        """An IRQ is served from `start` (ns) on; a FIQ may still interrupt it."""
        self.irq_open = True
        self.irq_number = number
        self.irq_start = start
        self.irq_cycles = cycles
        self.irq_latency = latency
        self.irq_row = row
        self.irq_items = items

    @cython.ccall
    def end_irq(self, time: cython.longlong) -> None:
        """The IRQ that is open, if any, was through at `time` (ns)."""
        if self.irq_open:
            self.irq_open = False
            self.put(
                INTERRUPT_RAN,
                self.irq_number,
                self.irq_start,
                time,
                self.irq_cycles,
                self.irq_latency,
                self.irq_row,
                self.irq_items,
            )
