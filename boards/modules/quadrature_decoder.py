# cython: boundscheck=False, wraparound=False, cdivision=True
# (ring places are 0 ... 63; what is divided in the tasks is above 0)
"""Incremental encoder: position from both edges of channel A (2X), rate from the time between edges.

The edge part runs in the fast interrupt of every edge, the update part once per slot. All arithmetic is
the firmware's: 32-bit integers and 16.16 fixed point, truncated where C truncates
(robot.md N4.1; appendix 4.6).
"""

from typing import Final

import cython

from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.foundation.numbers import divide_toward_zero, float_of_fixed

RING_MASK: Final = 63  # places of the 64 edge times that wait for the next slot; one stays empty
SLOT_CYCLES: Final = 30_000
LARGEST: Final = 0x7FFFFFFF  # of 32 bits

PI = 3.141592653589793
TIMER_HZ = 60000000  # the capture timer counts processor cycles


def normalised_gain(gain, low, high):
    """`gain` scaled by a power of two into low ... high (absolute value), truncated: (integer, shift).

    gain = integer / 2^shift to within the truncation; shift is negative for gains above `high`.
    """
    shift = 0
    while abs(gain) < low:
        gain *= 2.0
        shift += 1
    while abs(gain) > high:
        gain /= 2.0
        shift -= 1
    return int(gain), shift


@cython.final
@cython.cclass
class QuadratureDecoder:
    """One encoder. `pulses`: lines per turn; `gear`: turns of the encoder per turn of the joint, its sign the
    mounting. `position` is rad x 65536 and `rate` rad/s x 65536, both at the joint.

    `filter_exponent`: the rate filter moves by 1/2^n of the difference per slot.
    """

    # what an edge and a slot touch
    count: cython.longlong
    position: cython.longlong
    position_gain: cython.longlong
    position_shift: cython.longlong
    filter_exponent: cython.longlong
    write: cython.longlong
    read: cython.longlong
    rate_bits: cython.longlong
    sign: cython.longlong
    rate_gain: cython.longlong
    mean: cython.longlong
    idle: cython.longlong
    speed: cython.longlong
    filtered: cython.longlong
    rate: cython.longlong
    after_glitch: cython.bint
    ring: cython.longlong[64]
    # the rest
    glitches: cython.longlong
    dropped_times: cython.longlong
    errors: ErrorModule
    glitch_code: cython.longlong
    full_code: cython.longlong
    rate_shift: cython.longlong
    rad_per_count: cython.double

    def __init__(self, pulses, gear, errors: ErrorModule, glitch_code, full_code, filter_exponent=4) -> None:
        self.errors = errors
        self.glitch_code = glitch_code
        self.full_code = full_code
        per_count = PI / (pulses * gear)
        self.position_gain, self.position_shift = normalised_gain(per_count * 65536.0, 16384.0, 65535.0)
        self.rate_gain, self.rate_shift = normalised_gain(per_count * TIMER_HZ, 4096.0, 16383.0)
        # counts/cycle x 2^31 x 2^16 of the filter, times rad x 60e6/count x 2^shift: 31 more bits go for 16.16
        self.rate_bits = self.rate_shift + 31
        self.rad_per_count = per_count
        self.filter_exponent = filter_exponent
        self.count = 0
        self.position = 0
        self.rate = 0
        # the interrupt's side
        self.ring = [0] * 64  # RING_MASK + 1
        self.write = 0
        self.read = 0
        self.glitches = 0
        self.dropped_times = 0
        # the slot's side
        self.sign = 0  # of the times that are believed; none before the first two
        self.after_glitch = False
        self.mean = LARGEST  # cycles between counts; the longest: standing still
        self.idle = 0
        self.speed = 0  # counts per cycle x 2^31, unfiltered
        self.filtered = 0  # the same x 65536, so that the filter's fraction stays

    @cython.ccall
    def edge(self, step: cython.longlong, elapsed: cython.longlong) -> None:
        """An edge of channel A as the fast interrupt sees it: `step` 1 or -1, `elapsed` cycles since the edge before.

        The time is kept for the next slot with the sign of the step; when the ring is full it is lost, the count is
        not.
        """
        write: cython.longlong = self.write
        after: cython.longlong = (write + 1) & RING_MASK
        self.count += step
        if after == self.read:
            self.dropped_times += 1
            self.errors.report(self.full_code)
        else:
            self.ring[write] = step * elapsed
            self.write = after

    @cython.ccall
    def glitch(self) -> None:
        """The pin's level did not agree with the armed edge: nothing counted, a time of 0 stored."""
        self.glitches += 1
        self.edge(0, 0)

    def update_angle(self) -> None:
        """Slot task: position from the count, floored."""
        # shifts are 8 ... 11 on the robot, here and in the rate; never negative for real encoders
        self.position = (self.count * self.position_gain) >> self.position_shift

    def update_rate(self):
        """Slot task: rate from the edge times since the last slot. Returns their number, None for none.

        A change of direction needs two times in a row to be believed, the first one after power-up as well: if the
        second has not come yet, the first is left for the next slot. A zero or a single time of the other sign is a
        glitch, and the time that follows it is not used either, also when it comes in a later slot.
        """
        if self.read == self.write:
            self._be_silent()
            return None
        total: cython.longlong = 0
        valid: cython.longlong = 0
        seen: cython.longlong = 0
        here: cython.longlong = self.read
        write: cython.longlong = self.write
        after: cython.longlong
        elapsed: cython.longlong
        while here != write:
            elapsed = self.ring[here]
            after = (here + 1) & RING_MASK
            if elapsed * self.sign > 0:
                if not self.after_glitch:
                    self.idle = 0
                    total += elapsed
                    valid += 1
                self.after_glitch = False
            elif elapsed == 0:
                self._note_glitch()
            elif after == write:
                break  # alone at the end: judged when its successor is here
            elif (self.ring[after] > 0) if elapsed > 0 else (self.ring[after] < 0):
                self.sign = 1 if elapsed > 0 else -1
                total = 0
                valid = 0
                continue  # the same time again, which now has the right sign
            else:
                self._note_glitch()
            seen += 1
            here = after
        if valid == 0:
            self._be_silent()
        else:
            self._filter(valid, total)
        if seen == 0:
            return None
        self.read = here
        return seen

    @cython.cfunc
    def _note_glitch(self) -> cython.void:
        """Report an impossible time in the ring as an error; the next time is not used."""
        self.errors.report(self.glitch_code)
        self.after_glitch = True

    @cython.cfunc
    def _be_silent(self) -> cython.void:
        """A slot without a valid time: the longer the silence, the slower it must be, so the rate falls with the
        inverse of the silence."""
        mean: cython.longlong = self.mean
        if self.idle < LARGEST - SLOT_CYCLES:
            self.idle += SLOT_CYCLES
        if mean > 0:
            self._filter(1, self.idle if self.idle > mean else mean)
        else:
            self._filter(1, -self.idle if self.idle > -mean else mean)

    @cython.cfunc
    def _filter(self, times: cython.longlong, total: cython.longlong) -> cython.void:
        """Follow `times` edge times whose sum is `total` cycles, with the sign of their direction."""
        filtered: cython.longlong = self.filtered
        if total > 0:
            self.speed = times * (LARGEST // total)
            self.mean = total // times
        else:
            self.speed = -times * (LARGEST // -total)
            self.mean = -(-total // times)
        filtered += ((self.speed << 16) >> self.filter_exponent) - (filtered >> self.filter_exponent)
        self.filtered = filtered
        self.rate = (self.rate_gain * filtered) >> self.rate_bits

    @cython.ccall
    @cython.exceptval(check=False)
    def position_rad(self) -> cython.double:
        """Angle of the joint in rad, as published."""
        return float_of_fixed(self.position)

    @cython.ccall
    @cython.exceptval(check=False)
    def rate_rad_s(self) -> cython.double:
        """Rate of the joint in rad/s, as published."""
        return float_of_fixed(self.rate)

    @cython.ccall
    def set_position(self, position: cython.longlong) -> None:
        """Set the count so that the position reads `position` (rad x 65536) from the next slot on."""
        self.count = self.count_at(position)

    @cython.ccall
    @cython.exceptval(check=False)
    def count_at(self, position: cython.longlong) -> cython.longlong:
        """The count at `position` (rad x 65536), truncated as in C."""
        return divide_toward_zero(position << self.position_shift, self.position_gain)
