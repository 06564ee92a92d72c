# cython: boundscheck=False, wraparound=False
# (every index below is a transmit buffer, 1 ... 3, as bus and controller have checked)
"""The ends of transmissions: a bus knows them from the start of the frame on, and programs rarely wait for them.

Bus and controller hold the same object: the bus writes the end, and the controller processes it when a register that
depends on it is read. An end is sent as a message (CAN_TX_DONE) where a program waits for it, and between processes.
"""

import cython

from ranger_sim.foundation.events import NEVER

BY_MESSAGE = NEVER + 1


@cython.final
@cython.cclass
class TransmitEnds:
    """By transmit buffer 1 ... 3: `times`, the time (ns) from which it is free again, and `statuses`, TX_*.

    A time is NEVER while the frame has not started, and when the controller has processed the end; BY_MESSAGE where the
    bus shall send a message. `order`: of such messages.
    """

    times: cython.longlong[4]
    statuses: cython.longlong[4]
    order: cython.longlong

    def __init__(self, by_message=False) -> None:
        unknown: cython.longlong = BY_MESSAGE if by_message else NEVER
        self.times = [unknown] * 4
        self.statuses = [0] * 4
        self.order = 0

    @cython.ccall
    @cython.exceptval(check=False)
    def write(self, buffer: cython.longlong, time: cython.longlong, status: cython.longlong) -> cython.bint:
        """Called by the bus: the transmission from `buffer` ends at `time`. False when it shall send a message
        instead."""
        if self.times[buffer] != NEVER:
            return False
        self.times[buffer] = time
        self.statuses[buffer] = status
        return True
