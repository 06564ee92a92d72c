"""Analog voltages at a chip's pins: a straight line per pin between two instants, set from outside."""

import array

import cython


class AnalogPins:
    """`count` analog pins; each holds one line segment (ns, V) to (ns, V), 0 V until it is first set.

    A pin may instead follow a table outside (`follow`), in which a whole row of voltages changes at once.
    """

    def __init__(self, count=32) -> None:
        self.count = count
        self.start_times = array.array("q", [0]) * count
        self.end_times = array.array("q", [0]) * count
        self.start_values = array.array("d", [0.0]) * count
        self.end_values = array.array("d", [0.0]) * count
        self.places = array.array("q", [-1]) * count
        self.feed_times = array.array("q", [0, 0])
        self.feed_starts = array.array("d", [0.0])
        self.feed_ends = array.array("d", [0.0])

    def follow(self, index, times, starts, ends, place) -> None:
        """From now on pin `index` runs from `starts[place]` at `times[0]` to `ends[place]` at `times[1]`, whatever
        stands there when it is read. All pins of a chip follow the same three arrays (int64 ns, V, V)."""
        self.feed_times = times
        self.feed_starts = starts
        self.feed_ends = ends
        self.places[index] = place

    def set_pair(
        self,
        index: cython.longlong,
        t0: cython.longlong,
        v0: cython.double,
        t1: cython.longlong,
        v1: cython.double,
    ) -> None:
        """The voltage of pin `index` runs straight from `v0` at `t0` to `v1` at `t1`; it follows nothing more."""
        self.places[index] = -1
        self.start_times[index] = t0
        self.start_values[index] = v0
        self.end_times[index] = t1
        self.end_values[index] = v1

    def volts(self, index: cython.longlong, time: cython.longlong) -> cython.double:
        """Voltage of pin `index` at `time`; before and after its line the nearer end holds."""
        place: cython.longlong = self.places[index]
        t0: cython.longlong
        t1: cython.longlong
        v0: cython.double
        v1: cython.double
        if place >= 0:
            t0 = self.feed_times[0]
            t1 = self.feed_times[1]
            v0 = self.feed_starts[place]
            v1 = self.feed_ends[place]
        else:
            t0 = self.start_times[index]
            t1 = self.end_times[index]
            v0 = self.start_values[index]
            v1 = self.end_values[index]
        if time >= t1:
            return v1
        if time <= t0:
            return v0
        return v0 + (v1 - v0) * ((time - t0) / (t1 - t0))
