# cython: boundscheck=False, wraparound=False
# (codes are held against the table, places of the ring are 0 ... 31)
"""Errors of one board: noted anywhere, collected once per slot, sent one at a time (appendix 4.9).

An error frame's value word holds the code (bits 0-15), the board's number (16-21) and how often it came
since it was last sent (22-31, modulo 1024); its time word is that of the first (robot.md N1.7, N4.12, T4.2).
"""

from typing import Final

import cython

from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.foundation.numbers import integers

CODES: Final = 1024  # codes 0 ... CODES-1 can be noted (the table has about 120)
# Errors that wait to be sent: a ring of 32, with a separate flag for empty.
RING_MASK: Final = 31
MOST_WAITING: Final = 32
# Fields of an error word: code, number of the board, count.
COUNT_MASK: Final = 1023
CODE_MASK: Final = 0xFFFF
BOARD_MASK: Final = 0x3F
BOARD_SHIFT: Final = 16
COUNT_SHIFT: Final = 22


def error_word(code, board, count):
    """Value word of an error frame: 16-bit code, 6-bit board number, 10-bit count (modulo 1024)."""
    return (code & CODE_MASK) | (board & BOARD_MASK) << BOARD_SHIFT | (count & COUNT_MASK) << COUNT_SHIFT


@cython.final
@cython.cclass
class ErrorModule:
    """The errors of board number `board`. Ground truth for tests and reports: `totals`, events per code.

    per_event: every recurrence counts (appendix); otherwise one per slot at most (firmware of 2016).
    lose_new_after_repeat: the firmware's fault that new errors of higher codes than a repeated one in a slot are lost.
    """

    # used in every slot
    flagged_count: cython.longlong
    waiting: cython.longlong
    # what an error touches
    time: NetworkTime
    per_event: cython.bint
    lose_new_after_repeat: cython.bint
    first: cython.longlong
    dropped: cython.longlong
    word: cython.longlong
    stamp: cython.longlong
    board: cython.longlong
    codes: cython.longlong[32]
    counts: cython.longlong[32]
    stamps: cython.longlong[32]
    totals: cython.longlong[::1]
    flags: cython.longlong[::1]
    flagged: cython.longlong[::1]

    def __init__(self, board, time: NetworkTime, per_event=True, lose_new_after_repeat=False) -> None:
        self.board = board
        self.time = time
        self.per_event = per_event
        self.lose_new_after_repeat = lose_new_after_repeat
        self.totals = integers(CODES)
        # flags of this slot: events per code, and which codes have any, ascending as their flags are looked through
        self.flags = integers(CODES)
        self.flagged = integers(CODES)
        self.flagged_count = 0
        self.codes = [0] * 32  # RING_MASK + 1
        self.counts = [0] * 32  # RING_MASK + 1
        self.stamps = [0] * 32  # RING_MASK + 1
        self.first = 0
        self.waiting = 0
        self.dropped = 0
        self.word = 0
        self.stamp = 0

    @cython.ccall
    def report(self, code: cython.longlong) -> cython.void:
        """Note error `code`; it goes into the ring at the end of the slot. Codes above the table are taken
        as 0 (DEFAULT), so a wrong call is visible rather than lost."""
        place: cython.longlong
        if code < 0 or code >= CODES:
            code = 0
        self.totals[code] += 1
        if self.flags[code] == 0:
            place = self.flagged_count
            while place > 0 and self.flagged[place - 1] > code:
                self.flagged[place] = self.flagged[place - 1]
                place -= 1
            self.flagged[place] = code
            self.flagged_count += 1
        self.flags[code] += 1

    @cython.ccall
    def update(self):
        """Slot task: move the flags of this slot into the ring; returns how many codes there were, None for none.

        A full ring is not searched, because its ends have met: what waits there already is put in once more, in place
        of the oldest.
        """
        moved: cython.longlong = self.flagged_count
        repeated: cython.bint = False
        i: cython.longlong
        j: cython.longlong
        place: cython.longlong
        code: cython.longlong
        events: cython.longlong
        found: cython.bint
        if moved == 0:
            return None
        for i in range(moved):
            code = self.flagged[i]
            events = self.flags[code] if self.per_event else 1
            self.flags[code] = 0
            found = False
            for j in range(self.waiting if self.waiting < MOST_WAITING else 0):
                place = (self.first + j) & RING_MASK
                if self.codes[place] == code:
                    self.counts[place] += events
                    found = True
                    break
            if found:
                repeated = True
                continue
            if repeated and self.lose_new_after_repeat:
                continue
            if self.waiting == MOST_WAITING:  # full: the oldest goes
                self.first = (self.first + 1) & RING_MASK
                self.waiting -= 1
                self.dropped += 1
            place = (self.first + self.waiting) & RING_MASK
            self.codes[place] = code
            self.counts[place] = events
            self.stamps[place] = self.time.ms
            self.waiting += 1
        self.flagged_count = 0
        return moved

    @cython.ccall
    @cython.exceptval(check=False)
    def take(self) -> cython.bint:
        """Take the oldest waiting error into `word` and `stamp`; False when none waits."""
        if self.waiting == 0:
            return False
        place: cython.longlong = self.first
        self.word = (
            (self.codes[place] & CODE_MASK)
            | (self.board & BOARD_MASK) << BOARD_SHIFT
            | (self.counts[place] & COUNT_MASK) << COUNT_SHIFT
        )
        self.stamp = self.stamps[place]
        self.first = (self.first + 1) & RING_MASK
        self.waiting -= 1
        return True
