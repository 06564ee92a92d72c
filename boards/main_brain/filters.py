"""Second-order Butterworth low-pass filters of the estimator, and their two ways of being run.

Bilinear design: with r = 2 f_c/f_s and c = tan(pi/2 (1 - r)),
b0 = 1/(1 + sqrt(2) c + c^2), b1 = 2 b0, b2 = b0, a1 = -2 (c^2 - 1) b0, a2 = (1 - sqrt(2) c + c^2) b0
(robot.md C3.2; at 10 Hz and 1 kHz it gives the record walk's coefficients of robot.md C3.1).
"""

from math import pi
from typing import Final

import cython
from cython.cimports.libc.math import sqrt, tan

# ms after which the slowest filter rests to the last bit of a double: its poles lie at radius 0.957
SETTLED: Final = 2000

# C variables when compiled: Cython makes a Python object of every literal above 31 bits.
_MASK: cython.longlong = 4294967295
_NEWEST: cython.longlong = 2147483647


@cython.cclass
class ButterworthFilter:
    """A filter for data that arrive with ms stamps or once per tick.

    cutoff_hz, sample_hz: corner and rate of the design. `output` holds the filtered value; the first
    datum sets the filter to rest at that value. `violations` counts stamps that ran backwards.
    """

    b0: cython.double
    b1: cython.double
    b2: cython.double
    a1: cython.double
    a2: cython.double
    violations: cython.longlong
    stamp: cython.longlong
    started: cython.bint
    x1: cython.double
    x2: cython.double
    y1: cython.double
    y2: cython.double
    output: cython.double
    held: cython.double

    def __init__(self, cutoff_hz: cython.double, sample_hz: cython.double) -> None:
        c: cython.double = tan(0.5 * pi * (1.0 - 2.0 * cutoff_hz / sample_hz))
        root: cython.double = sqrt(2.0)
        self.b0 = 1.0 / (1.0 + root * c + c * c)
        self.b1 = 2.0 * self.b0
        self.b2 = self.b0
        self.a1 = -2.0 * (c * c - 1.0) * self.b0
        self.a2 = (1.0 - root * c + c * c) * self.b0
        self.violations = 0
        self.started = False
        self.stamp = 0
        self.held = 0.0
        self.x1 = 0.0
        self.x2 = 0.0
        self.y1 = 0.0
        self.y2 = 0.0
        self.output = 0.0

    @cython.ccall
    def rest_at(self, value: cython.double) -> None:
        """Forget the past as if the input had always been `value`."""
        self.x1 = value
        self.x2 = value
        self.y1 = value
        self.y2 = value
        self.output = value
        self.started = True

    @cython.ccall
    def push(self, value: cython.double) -> cython.double:
        """One sample; returns the output."""
        y: cython.double
        if not self.started:
            self.rest_at(value)
            return value
        y = self.b0 * value + self.b1 * self.x1 + self.b2 * self.x2 - self.a1 * self.y1 - self.a2 * self.y2
        self.x2 = self.x1
        self.x1 = value
        self.y2 = self.y1
        self.y1 = y
        self.output = y
        return y

    @cython.ccall
    def push_stamped(self, value: cython.double, stamp_ms: cython.longlong) -> cython.double:
        """A datum with its u32 ms stamp: a stamp n ms later means n - 1 samples of the old, one of the new.

        With an unchanged stamp the datum only takes the old one's place. With an older stamp it does so too, and the
        output stays (robot.md C3.1); this is a violation.
        """
        gap: cython.longlong
        old: cython.double
        if not self.started:
            self.stamp = stamp_ms
            self.held = value
            self.rest_at(value)
            return value
        gap = (stamp_ms - self.stamp) & _MASK
        old = self.held
        self.stamp = stamp_ms
        self.held = value
        if gap > _NEWEST:
            self.violations += 1
            return self.output
        if gap == 0:
            return self.output
        if gap > SETTLED:
            self.rest_at(old)
            return self.push(value)
        while gap > 1:
            self.push(old)
            gap -= 1
        return self.push(value)
