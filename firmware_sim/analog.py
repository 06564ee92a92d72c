# cython: boundscheck=False, wraparound=False, cdivision=True
# (pins are 0 ... 31, held against that where they are set; places are those of the table that is followed; what is
# divided by is above 0)
"""Analog voltages at a chip's pins: a straight line per pin between two instants, set from outside."""

import cython

from ranger_sim.foundation.user_error import FirmwareError

PINS = 32


@cython.final
@cython.cclass
class AnalogPins:
    """32 analog pins; each holds one line segment (ns, V) to (ns, V), 0 V until it is first set.

    A pin may instead follow a table outside (`follow`), in which a whole row of voltages changes at once.
    """

    # where the three arrays of `feed` begin: pointers are a fraction of what three array fields take in the cache
    feed_times: cython.p_longlong
    feed_starts: cython.p_double
    feed_ends: cython.p_double
    places: cython.longlong[32]
    count: cython.longlong
    start_times: cython.longlong[32]
    end_times: cython.longlong[32]
    start_values: cython.double[32]
    end_values: cython.double[32]
    feed: object

    def __init__(self) -> None:
        self.count = PINS
        self.start_times = [0] * 32
        self.end_times = [0] * 32
        self.start_values = [0.0] * 32
        self.end_values = [0.0] * 32
        self.places = [-1] * 32  # in the table outside; -1: the pin has a line of its own
        self.feed = None

    def follow(
        self, index, times: cython.longlong[::1], starts: cython.double[::1], ends: cython.double[::1], place
    ) -> None:
        """From now on pin `index` runs from `starts[place]` at `times[0]` to `ends[place]` at `times[1]`, whatever
        stands there when it is read. All pins of a chip follow the same three arrays (int64 ns, V, V)."""
        self._check(index)
        self.feed = (times, starts, ends)  # keeps them alive
        if cython.compiled:
            self.feed_times = cython.address(times[0])
            self.feed_starts = cython.address(starts[0])
            self.feed_ends = cython.address(ends[0])
        else:
            self.feed_times = times
            self.feed_starts = starts
            self.feed_ends = ends
        self.places[index] = place

    def _check(self, index) -> None:
        if not 0 <= index < PINS:
            raise FirmwareError(f"analog pin {index} is not 0 ... {PINS - 1}")

    @cython.ccall
    def set_pair(
        self,
        index: cython.longlong,
        t0: cython.longlong,
        v0: cython.double,
        t1: cython.longlong,
        v1: cython.double,
    ) -> None:
        """The voltage of pin `index` runs straight from `v0` at `t0` to `v1` at `t1`; it follows nothing more."""
        self._check(index)
        self.places[index] = -1
        self.start_times[index] = t0
        self.start_values[index] = v0
        self.end_times[index] = t1
        self.end_values[index] = v1

    @cython.ccall
    @cython.exceptval(check=False)
    def volts(self, index: cython.longlong, time: cython.longlong) -> cython.double:
        """Voltage of pin `index` at `time`; before and after its line the nearer end holds."""
        place: cython.longlong = self.places[index]
        t0: cython.longlong
        t1: cython.longlong
        v0: cython.double
        v1: cython.double
        passed: cython.double
        length: cython.double
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
        passed = time - t0
        length = t1 - t0
        return v0 + (v1 - v0) * (passed / length)
