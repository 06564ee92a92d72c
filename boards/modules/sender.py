"""Sending of a board's own variables: words, stamped with the network time, into the ring of a link."""

import cython

from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.foundation.numbers import word_of_float, word_of_i32


@cython.cclass
class Sender:
    """Base of the takers of frames from a board's program: a CAN bus's end, the router's own ring.

    `time`: the network time that stamps them. `late_cycles`: cycles of a line of the schedule after the request of its
    frame, in a separate task.
    """

    time: NetworkTime
    late_cycles: cython.longlong

    def __init__(self, time: NetworkTime, late_cycles=0) -> None:
        self.time = time
        self.late_cycles = late_cycles

    @cython.ccall
    def send_words(
        self, identifier: cython.longlong, value_word: cython.longlong, time_word: cython.longlong
    ) -> cython.bint:
        """Queue a frame of two words (0 ... 2^32-1 each); False when the queue is full and it is lost."""
        return False

    @cython.ccall
    def build(self, identifier: cython.longlong, value_word: cython.longlong, time_word: cython.longlong) -> None:
        """Take a frame that a line of the schedule has made; here it is sent at once."""
        self.send_words(identifier, value_word, time_word)

    @cython.ccall
    def send_float(self, identifier: cython.longlong, value: cython.double) -> cython.bint:
        """Queue `value` as a single float, stamped with the network time of now."""
        return self.send_words(identifier, word_of_float(value), self.time.ms)

    @cython.ccall
    def send_int(self, identifier: cython.longlong, value: cython.longlong) -> cython.bint:
        """Queue a 32-bit whole number, stamped with the network time of now."""
        return self.send_words(identifier, word_of_i32(value), self.time.ms)
