# cython: boundscheck=False, wraparound=False
# (every index below is an id checked against the table's size, or a position in the caller's list of ids)
"""The main brain's data at run time: one 32-bit word and one ms stamp per id, with a read flag per subscriber.

It corresponds to the robot's io data module (robot.md N4.13). A write makes a value new for every subscriber. An id
beyond the table raises no exception, as in the firmware: it reads 0, changes nothing, and is reported through
`out_of_range_count`, `out_of_range_id` and the attribute `on_out_of_range`, which the board sets to raise MB_IO_ID_OOR.
"""

import array

import cython

from ranger_sim.foundation.numbers import float_of_word, word_of_float, wrap_i32

# Bits of the read flags (robot.md N4.13).
BLUETOOTH = 0
SSP = 1
LABVIEW = 2
LCD = 3
MB_ERR_DIST = 4
ESTIMATOR = 5
FSM = 6
SUBSCRIBERS = ("BLUETOOTH", "SSP", "LABVIEW", "LCD", "MB_ERR_DIST", "ESTIMATOR", "FSM")

TIMESTAMP = 0  # the id whose stamp is the network time
# A C variable when compiled: Cython makes a Python object of every literal above 31 bits.
_MASK: cython.longlong = 4294967295


@cython.final
@cython.cclass
class DataStore:
    """Records 0 ... size-1. At the start all words and stamps are 0 and every record is unread by every subscriber."""

    size: cython.longlong
    words: cython.longlong[::1]
    stamps: cython.longlong[::1]
    unread: cython.uchar[::1]
    out_of_range_count: cython.longlong
    out_of_range_id: cython.longlong
    on_out_of_range: object

    def __init__(self, size) -> None:
        self.size = size
        self.words = array.array("q", [0]) * size
        self.stamps = array.array("q", [0]) * size
        self.unread = array.array("B", [0x7F]) * size
        self.out_of_range_count = 0
        self.out_of_range_id = -1
        self.on_out_of_range = None

    @cython.ccall
    def move(self, words) -> None:
        """Keep the words of the records in `words` from now on, unchanged: memory that processes share."""
        words[:] = memoryview(self.words)
        self.words = words

    @cython.ccall
    def has(self, number: cython.longlong) -> cython.bint:
        """True when `number` is an id of the table; otherwise reports the miss and returns False."""
        if 0 <= number < self.size:
            return True
        self.out_of_range_count += 1
        self.out_of_range_id = number
        if self.on_out_of_range is not None:
            self.on_out_of_range()
        return False

    # ---- frames: word and stamp together

    @cython.ccall
    def set_word(self, number: cython.longlong, word: cython.longlong, stamp: cython.longlong) -> cython.bint:
        """Store the two words of a frame unchanged; new for every subscriber. True when the table has the id."""
        if 0 <= number < self.size or self.has(number):
            self.words[number] = word & _MASK
            self.stamps[number] = stamp & _MASK
            self.unread[number] = 0x7F
            return True
        return False

    @cython.ccall
    def get_word(self, number: cython.longlong) -> cython.longlong:
        """The value word, 0 ... 2^32-1."""
        if 0 <= number < self.size or self.has(number):
            return self.words[number]
        return 0

    # ---- typed access: the stamp is the network time that the main brain received last

    @cython.ccall
    def set_float(self, number: cython.longlong, value: cython.double) -> cython.bint:
        """Store a number, rounded to single precision; True when the table has the id."""
        if 0 <= number < self.size or self.has(number):
            self.words[number] = word_of_float(value)
            self.stamps[number] = self.stamps[0]
            self.unread[number] = 0x7F
            return True
        return False

    @cython.ccall
    def get_float(self, number: cython.longlong) -> cython.double:
        """The word read as a single-precision number."""
        if 0 <= number < self.size or self.has(number):
            return float_of_word(self.words[number])
        return 0.0

    @cython.ccall
    def set_int(self, number: cython.longlong, value: cython.longlong) -> cython.bint:
        """Store a signed integer, of which only the low 32 bits are kept; True when the table has the id."""
        if 0 <= number < self.size or self.has(number):
            self.words[number] = value & _MASK
            self.stamps[number] = self.stamps[0]
            self.unread[number] = 0x7F
            return True
        return False

    @cython.ccall
    def get_int(self, number: cython.longlong) -> cython.longlong:
        """The word read as a signed integer, -2^31 ... 2^31-1."""
        if 0 <= number < self.size or self.has(number):
            return wrap_i32(self.words[number])
        return 0

    @cython.ccall
    def set_u32(self, number: cython.longlong, value: cython.longlong) -> cython.bint:
        """Store an unsigned integer, of which only the low 32 bits are kept; True when the table has the id."""
        return self.set_int(number, value)

    @cython.ccall
    def get_u32(self, number: cython.longlong) -> cython.longlong:
        """The word read as an unsigned integer, 0 ... 2^32-1."""
        return self.get_word(number)

    # ---- time

    @cython.ccall
    def stamp(self, number: cython.longlong) -> cython.longlong:
        """Network time of the last write in ms, 0 ... 2^32-1."""
        if 0 <= number < self.size or self.has(number):
            return self.stamps[number]
        return 0

    @cython.ccall
    @cython.exceptval(check=False)
    def network_time_ms(self) -> cython.longlong:
        """The network time received last, 0 ... 2^32-1 ms."""
        return self.stamps[0]

    @cython.ccall
    def age_ms(self, number: cython.longlong, now: cython.longlong) -> cython.longlong:
        """Age of the value at `now`, ms; correct across one wrap of the 32-bit count."""
        if 0 <= number < self.size or self.has(number):
            return (now - self.stamps[number]) & _MASK
        return 0

    # ---- read flags

    @cython.ccall
    def is_unread(self, number: cython.longlong, subscriber: cython.longlong) -> cython.bint:
        """True when the value was written after `subscriber` read it last."""
        if 0 <= number < self.size or self.has(number):
            return (self.unread[number] >> subscriber) & 1 == 1
        return False

    @cython.ccall
    def mark_read(self, number: cython.longlong, subscriber: cython.longlong) -> cython.bint:
        """Mark the value as read by `subscriber` only; True when the table has the id."""
        if 0 <= number < self.size or self.has(number):
            self.unread[number] &= ~(1 << subscriber)
            return True
        return False

    @cython.ccall
    def mark_unread(self, number: cython.longlong) -> cython.bint:
        """Mark the value as new for every subscriber though it was not written; True when the table has the id."""
        if 0 <= number < self.size or self.has(number):
            self.unread[number] = 0x7F
            return True
        return False

    @cython.ccall
    def next_unread(
        self, numbers: cython.longlong[::1], start: cython.longlong, subscriber: cython.longlong
    ) -> cython.longlong:
        """Position (from `start` on) in the list of ids of the first that `subscriber` has not read; -1 if none."""
        i: cython.longlong
        number: cython.longlong
        for i in range(start, len(numbers)):
            number = numbers[i]
            if (0 <= number < self.size or self.has(number)) and (self.unread[number] >> subscriber) & 1:
                return i
        return -1
