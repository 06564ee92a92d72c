"""Bits of a bus whose level is inverted for everybody: chosen frames, chosen bits, and noise."""

import cython

if not cython.compiled:
    from math import log

    from ranger_sim.foundation.events import NEVER

HIGHEST_RATE = 0.1  # bit error rate; chosen by us: beyond it no frame gets through


class Disturbance:
    """What disturbs a bus. Bits are counted since power-up.

    `next_bit`: the next bit that is hit; NEVER when none is, -1 when the next frame is hit wherever it lies.
    `noise`: the RandomStream of the bit error rate.
    """

    def __init__(self, noise) -> None:
        self.noise = noise
        self.frames_left = 0
        self.position = -1
        self.planned_bits = []
        self.bit_error_rate = 0.0
        self.next_noise_bit = NEVER
        self._aim()

    def hit_frames(self, count, position) -> None:
        """Hit the next `count` frames at bit `position`, negative: in their middle."""
        self.frames_left = count
        self.position = position
        self._aim()

    def hit_bit(self, bit) -> None:
        """Hit one bit, which nobody has decided yet."""
        self.planned_bits.append(bit)
        self.planned_bits.sort()
        self._aim()

    def set_rate(self, rate, bit) -> None:
        """Hit each bit after `bit` with probability `rate`."""
        self.bit_error_rate = rate
        self.next_noise_bit = bit
        self._draw_noise()
        self._aim()

    def _aim(self) -> None:
        planned: cython.longlong = self.planned_bits[0] if self.planned_bits else NEVER
        self.next_bit = -1 if self.frames_left > 0 else min(planned, self.next_noise_bit)

    def _draw_noise(self) -> None:
        """The next disturbed bit: distances between them are exponential with mean 1 / rate."""
        u: cython.double
        distance: cython.double
        if self.bit_error_rate > 0.0:
            u = self.noise.uniform()
            distance = -log(1.0 - u) / self.bit_error_rate
            self.next_noise_bit += 1 + int(distance)
        else:
            self.next_noise_bit = NEVER

    def strike(self, first: cython.longlong, last: cython.longlong, vulnerable: cython.longlong) -> cython.longlong:
        """Position in the frame on bits `first` ... `last` of the bit that is hit, or -1.

        `vulnerable`: the first position behind the arbitration field. What falls on bits before the frame is
        forgotten; what falls into its arbitration field is moved behind it.
        """
        position: cython.longlong = -1
        following: cython.longlong
        if self.frames_left > 0:
            self.frames_left -= 1
            position = self.position if self.position >= 0 else (last - first) // 2
        while self.planned_bits and self.planned_bits[0] < first:
            self.planned_bits.pop(0)
        if self.next_noise_bit < first:
            # what fell on idle bits is forgotten; the distance to the next one has no memory
            self.next_noise_bit = first - 1
            self._draw_noise()
        following = min(self.planned_bits[0] if self.planned_bits else NEVER, self.next_noise_bit)
        if following < last and position < 0:
            position = following - first
        self._aim()
        return -1 if position < 0 else min(max(position, vulnerable), last - first - 1)
