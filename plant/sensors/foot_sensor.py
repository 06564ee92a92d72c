"""The contact sensors in a pair of feet: the gap of the C-shaped foot, seen by an optical interrupter.

A load on the foot closes the gap (appendix 2.4, 3.8). Counts of the board's converter are 700 in swing and 7000
in stance (robot.md C3.2). Between them (EQUATIONS 11.4):

    target = swing + span (share + (1 - share) min(1, load / full_load))   in contact, swing otherwise
    rise_time_constant x d(counts)/dt = target - counts

`rise_time_constant` is the one number of the dynamics. The robot's strike is known 14 +/- 3 ms after it happens
(appendix 4.3) and the chain from the converter to the swing flag takes about 5 ms, so the sole needs about 9 ms
to the threshold of 2000 counts above the baseline. Chosen by us: 12 ms; with the load of the leading foot
rising to the weight over 30 ms of double stance that makes 9 ms (a test holds it).
`share` is the part of the gap that the impact itself closes at small loads: chosen by us, 0.4. `full_load`, where the
gap is closed and the stop takes over (appendix 2.4): chosen by us, half of the weight, 50 N.
"""

import cython
from cython.cimports.libc.math import exp

from ranger_sim.foundation.user_error import ModelError

SWING_COUNTS = 700.0
STANCE_COUNTS = 7000.0
VOLTS_PER_COUNT = 2.5 / 8192.0  # ADS7871 at gain 1 with its 2.5 V reference, robot.md N4.5


@cython.final
@cython.cclass
class FootSensors:
    """Left and right sensor of one foot pair; `left_V` and `right_V` now, without noise.

    `left_gain`, `right_gain`: how far each goes of the nominal span (both feet of a pair carry the same load).
    """

    closure: cython.double
    last_h: cython.double
    decay: cython.double
    share: cython.double
    per_N: cython.double
    left_gain: cython.double
    right_gain: cython.double
    swing_counts: cython.double
    span_counts: cython.double
    left_V: cython.double
    right_V: cython.double
    rise_time_constant_s: cython.double
    name: str

    def __init__(
        self,
        name,
        rise_time_constant_s=0.012,
        share=0.4,
        full_load_N=50.0,
        left_gain=1.0,
        right_gain=1.0,
        swing_counts=SWING_COUNTS,
        stance_counts=STANCE_COUNTS,
    ) -> None:
        if rise_time_constant_s <= 0.0 or full_load_N <= 0.0 or not 0.0 <= share <= 1.0:
            raise ModelError(
                f"foot sensors {name}: rise_time_constant_s {rise_time_constant_s} and full_load_N {full_load_N} "
                f"must be above 0, share {share} between 0 and 1"
            )
        self.name = name
        self.rise_time_constant_s = rise_time_constant_s
        self.share = share
        self.per_N = (1.0 - share) / full_load_N
        self.left_gain = left_gain
        self.right_gain = right_gain
        self.swing_counts = swing_counts
        self.span_counts = stance_counts - swing_counts
        self.closure = 0.0  # of the span, 0 open ... 1
        self.last_h = 0.0
        self.decay = 1.0
        self.left_V = swing_counts * VOLTS_PER_COUNT
        self.right_V = swing_counts * VOLTS_PER_COUNT

    @cython.ccall
    def step(self, h: cython.double, contact: cython.bint, load_N: cython.double) -> cython.void:
        """`h` seconds on with this contact and vertical load (N, all of the foot pair)."""
        target: cython.double = 0.0
        if contact:
            target = self.share
            if load_N > 0.0:
                target += load_N * self.per_N
                if target > 1.0:
                    target = 1.0
        if h != self.last_h:
            self.last_h = h
            self.decay = exp(-h / self.rise_time_constant_s)
        target += (self.closure - target) * self.decay
        self.closure = target
        target *= self.span_counts
        self.left_V = (self.swing_counts + self.left_gain * target) * (2.5 / 8192.0)
        self.right_V = (self.swing_counts + self.right_gain * target) * (2.5 / 8192.0)

    @cython.ccall
    def settle(self, contact: cython.bint, load_N: cython.double) -> cython.void:
        """Take the steady value for this contact and load."""
        self.step(1000.0 * self.rise_time_constant_s, contact, load_N)
