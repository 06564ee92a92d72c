"""What passed on a bus, frame by frame."""

import cython


class FrameLog:
    """The first `capacity` frames since the last `take`; `dropped` counts those beyond. A `stream` takes them instead.

    A frame is a tuple (time_ns, identifier, flags, lo, hi, sending node), in order of their starts. time_ns is the
    instant at which receivers have it. An error frame stands where it ended: FLAG_ERROR, the instant of its end,
    lo = field (FIELD_*) and hi = position of the bit in which a node detected the error, the frame's sender first;
    identifier 0 and node -1 where nobody had sent, after a false start of frame.
    """

    def __init__(self, capacity) -> None:
        self.capacity = capacity
        self.frames = []
        self.dropped = 0
        self.stream = None  # a FrameStream

    def add(
        self,
        time: cython.longlong,
        identifier: cython.longlong,
        flags: cython.longlong,
        lo: cython.longlong,
        hi: cython.longlong,
        node: cython.longlong,
    ) -> None:
        """A frame has passed."""
        if self.stream is not None:
            self.stream.add(time, identifier, flags, lo, hi)
        elif len(self.frames) < self.capacity:
            self.frames.append((time, identifier, flags, lo, hi, node))
        else:
            self.dropped += 1

    def take(self) -> list:
        """The frames so far, which are forgotten here."""
        taken = self.frames
        self.frames = []
        return taken
