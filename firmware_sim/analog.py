"""Analog voltages at a chip's pins: a straight line per pin between two instants, set from outside."""

import array

import cython


class AnalogPins:
    """`count` analog pins; each holds one line segment (ns, V) to (ns, V), 0 V until it is first set."""

    def __init__(self, count=32) -> None:
        self.count = count
        self.start_times = array.array("q", [0]) * count
        self.end_times = array.array("q", [0]) * count
        self.start_values = array.array("d", [0.0]) * count
        self.end_values = array.array("d", [0.0]) * count

    def set_pair(
        self,
        index: cython.longlong,
        t0: cython.longlong,
        v0: cython.double,
        t1: cython.longlong,
        v1: cython.double,
    ) -> cython.void:
        """The voltage of pin `index` runs straight from `v0` at `t0` to `v1` at `t1`."""
        self.start_times[index] = t0
        self.start_values[index] = v0
        self.end_times[index] = t1
        self.end_values[index] = v1

    def volts(self, index: cython.longlong, time: cython.longlong) -> cython.double:
        """Voltage of pin `index` at `time`; before and after its line the nearer end holds."""
        t0: cython.longlong = self.start_times[index]
        t1: cython.longlong = self.end_times[index]
        v0: cython.double = self.start_values[index]
        if time >= t1:
            return self.end_values[index]
        if time <= t0:
            return v0
        return v0 + (self.end_values[index] - v0) * ((time - t0) / (t1 - t0))
