"""The main brain gathers every board's error frames and passes them on, one at a time.

Source: robot.md N4.12: called in one row (45.45 Hz); equal errors of one board are merged (counts
added, newest time kept) in a ring of 64 for the computer and one of 16 for the display. As intended by the
appendix, the next error goes out when the last one was read; by the quirk of 2016 the computer's variable
is marked new while its ring is empty, and the display's ring is never emptied.
"""

from typing import Any

import cython

from ranger_sim.boards.modules.error_module import ErrorModule, error_word
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.store import LABVIEW, MB_ERR_DIST, SSP, DataStore

SOURCES = ("ERROR_MB", "ERROR_MCH", "ERROR_MCFO", "ERROR_MCFI", "ERROR_MCSO", "ERROR_MCSI", "ERROR_UI", "ERROR_CSR")
COMPUTER_RING = 64
DISPLAY_RING = 16
UNREAD_LIMIT_MS = 1000  # chosen by us: without a computer on the line the next error replaces an unread one


@cython.final
@cython.cclass
class ErrorRing:
    """Errors waiting for one reader, oldest first: {(board, code): [count, stamp]}; the oldest goes when full."""

    size: cython.longlong
    dropped: cython.longlong
    waiting: dict

    def __init__(self, size: int) -> None:
        self.size = size
        self.waiting: dict[tuple[int, int], Any] = {}
        self.dropped = 0

    @cython.ccall
    def add(
        self, board: cython.longlong, code: cython.longlong, count: cython.longlong, stamp: cython.longlong
    ) -> None:
        entry = self.waiting.get((board, code))
        if entry is not None:
            entry[0] += count
            entry[1] = stamp
        else:
            if len(self.waiting) == self.size:
                del self.waiting[next(iter(self.waiting))]
                self.dropped += 1
            self.waiting[board, code] = [count, stamp]

    @cython.ccall
    def take(self) -> Any:
        """(word, stamp) of the oldest, or None."""
        if not self.waiting:
            return None
        board, code = next(iter(self.waiting))
        count, stamp = self.waiting.pop((board, code))
        return error_word(code, board, count), stamp


@cython.final
@cython.cclass
class ErrorDistribution:
    """`distribute()` is the task. `totals`: {(board number, code): count} of all that it has passed on."""

    store: DataStore
    errors: "ErrorModule"
    inverted: cython.bint
    source_ids: list
    id_own: cython.longlong
    id_computer: cython.longlong
    id_display: cython.longlong
    computer: ErrorRing
    display: ErrorRing
    computer_time_ms: cython.longlong
    totals: dict

    def __init__(self, store: Any, errors: Any, inverted: Any) -> None:
        self.store = store
        self.errors = errors  # this board's own error module
        self.inverted = inverted
        self.source_ids = [getattr(table, name) for name in SOURCES]
        self.id_own = table.ERROR_MB
        self.id_computer = table.ERROR_LABVIEW
        self.id_display = table.ERROR_LCD
        self.computer = ErrorRing(COMPUTER_RING)
        self.display = ErrorRing(DISPLAY_RING)
        self.computer_time_ms = -1  # network time at which ERROR_LABVIEW was last renewed
        self.totals: dict[Any, int] = {}

    def distribute(self) -> int:
        """Own error into ERROR_MB, new frames into the rings, one error to each reader; returns frames read."""
        store: DataStore = self.store
        number: cython.longlong
        word: cython.longlong
        stamp: cython.longlong
        now: cython.longlong
        read: cython.longlong = 0
        if self.errors.take():
            store.set_word(self.id_own, self.errors.word, self.errors.stamp)
        for number in self.source_ids:
            if not store.is_unread(number, MB_ERR_DIST):
                continue
            store.mark_read(number, MB_ERR_DIST)
            word = store.get_word(number)
            if word == 0:
                continue  # nothing was ever received: at the start every variable is unread
            stamp = store.stamp(number)
            board, code, count = word >> 16 & 0x3F, word & 0xFFFF, word >> 22
            self.computer.add(board, code, count, stamp)
            self.display.add(board, code, count, stamp)
            self.totals[board, code] = self.totals.get((board, code), 0) + count
            read += 1
        if self.inverted:
            if not self.computer.waiting:
                store.mark_unread(self.id_computer)
            return read
        now = store.network_time_ms()
        if self.computer.waiting and (
            not store.is_unread(self.id_computer, LABVIEW)
            or self.computer_time_ms < 0
            or now - self.computer_time_ms & 0xFFFFFFFF >= UNREAD_LIMIT_MS
        ):
            word, stamp = self.computer.take()
            store.set_word(self.id_computer, word, stamp)
            self.computer_time_ms = now
        if self.display.waiting and not store.is_unread(self.id_display, SSP):
            word, stamp = self.display.take()
            store.set_word(self.id_display, word, stamp)
        return read
