"""How a board's own variables leave it: words, stamped with the network time, into the ring of a link."""

import cython

from ranger_sim.boards.modules.network_time import NetworkTime

if not cython.compiled:
    from ranger_sim.foundation.numbers import word_of_float, word_of_i32


class Sender:
    """Base of what takes frames from a board's program: a CAN bus's end, the router's own ring.

    `time`: the network time that stamps them.
    """

    def __init__(self, time: NetworkTime) -> None:
        self.time = time

    def send_words(
        self, identifier: cython.longlong, value_word: cython.longlong, time_word: cython.longlong
    ) -> cython.bint:
        """Queue a frame of two words (0 ... 2^32-1 each); False when there is no room and it is lost."""
        return False

    def send_float(self, identifier: cython.longlong, value: cython.double) -> cython.bint:
        """Queue `value` as a single float, stamped with the network time of now."""
        return self.send_words(identifier, word_of_float(value), self.time.ms)

    def send_int(self, identifier: cython.longlong, value: cython.longlong) -> cython.bint:
        """Queue a 32-bit whole number, stamped with the network time of now."""
        return self.send_words(identifier, word_of_i32(value), self.time.ms)
