# cython: boundscheck=False, wraparound=False
# (every index below is a column of a row)
"""Log of the frames that passed on a bus."""

from typing import Final

import cython

from ranger_sim.foundation.row_stream import FrameStream, RowStream

TIMES_COLUMNS: Final = 7
# numbers of a FrameTimes row
TIMES_START: Final = 0  # first bit of the frame, ns
TIMES_ASKED: Final = 1  # its program requested it, ns; TIMES_START where no program had
TIMES_END: Final = 2  # end of its last bit, or of its error frame, ns
TIMES_IDENTIFIER: Final = 3
TIMES_SENDER: Final = 4  # (node + 1) << SENDER_SHIFT | transmit buffer << TIMES_BUFFER_SHIFT | flags; node -1: none
TIMES_LOW: Final = 5  # data bytes 0-3, or the field in which an error was detected (FIELD_*)
TIMES_HIGH: Final = 6  # data bytes 4-7, or the position of that bit in the frame
TIMES_BUFFER_SHIFT: Final = 12
SENDER_SHIFT: Final = 16


@cython.final
@cython.cclass
class FrameTimes(RowStream):
    """Request, start and end times of each frame of a bus: whole numbers, TIMES_COLUMNS per row.

    Rows are in the order in which the bus decided the frames, which is the order of their ends.
    """

    def __init__(self) -> None:
        RowStream.__init__(self, "q", TIMES_COLUMNS, False)

    @cython.ccall
    def add(
        self,
        start: cython.longlong,
        asked: cython.longlong,
        end: cython.longlong,
        identifier: cython.longlong,
        sender: cython.longlong,
        lo: cython.longlong,
        hi: cython.longlong,
    ) -> None:
        """Add a frame that was on the bus; `sender` as in TIMES_SENDER."""
        at: cython.longlong = self.used
        self.numbers[at + TIMES_START] = start
        self.numbers[at + TIMES_ASKED] = asked
        self.numbers[at + TIMES_END] = end
        self.numbers[at + TIMES_IDENTIFIER] = identifier
        self.numbers[at + TIMES_SENDER] = sender
        self.numbers[at + TIMES_LOW] = lo
        self.numbers[at + TIMES_HIGH] = hi
        self.finish_row(end)


@cython.final
@cython.cclass
class FrameLog:
    """The first `capacity` frames since the last `take`; `dropped` counts those beyond. A `stream`, if set, takes them
    instead.

    A frame is a tuple (time_ns, identifier, flags, lo, hi, sending node), in order of their starts. time_ns is the time
    at which receivers have it. An error frame is listed at its end: FLAG_ERROR, the time of its end, lo = field
    (FIELD_*) and hi = position of the bit in which a node detected the error, the frame's sender first; identifier 0
    and node -1 where no node had sent, after a false start of frame.

    `times`: None, or a FrameTimes that also records requests, starts and ends.
    """

    stream: "FrameStream"
    times: FrameTimes
    frames: list
    capacity: cython.longlong
    dropped: cython.longlong

    def __init__(self, capacity) -> None:
        self.capacity = capacity
        self.frames = []
        self.dropped = 0
        self.stream = None  # a FrameStream
        self.times = None

    @cython.cfunc
    def add(
        self,
        time: cython.longlong,
        identifier: cython.longlong,
        flags: cython.longlong,
        lo: cython.longlong,
        hi: cython.longlong,
        node: cython.longlong,
    ) -> None:
        """Record a frame that has passed."""
        if self.stream is not None:
            self.stream.add(time, identifier, flags, lo, hi)
        elif len(self.frames) < self.capacity:
            self.frames.append((time, identifier, flags, lo, hi, node))
        else:
            self.dropped += 1

    def add_fd(self, time, identifier, flags, data, node) -> None:
        """Record a CAN FD frame: `hi` holds all bytes from the fifth on."""
        if self.stream is not None:
            self.stream.add_fd(time, identifier, flags, data)
        elif len(self.frames) < self.capacity:
            lo, hi = int.from_bytes(data[:4], "little"), int.from_bytes(data[4:], "little")
            self.frames.append((time, identifier, flags, lo, hi, node))
        else:
            self.dropped += 1

    def take(self) -> list:
        """Return the frames so far and remove them."""
        taken = self.frames
        self.frames = []
        return taken
