"""Inverted bits of a bus, for all nodes: in chosen frames, at chosen bits, and from noise; or for one node."""

from typing import TYPE_CHECKING

import cython
from cython.cimports.libc.math import log

from ranger_sim.can_bus.frame import ARBITRATION_END, EXTENDED_ARBITRATION_END
from ranger_sim.foundation.events import FLAG_EXTENDED, NEVER

if TYPE_CHECKING:
    from ranger_sim.foundation.random_stream import RandomStream

HIGHEST_RATE = 0.1  # bit error rate; chosen by us: beyond it no frame gets through


@cython.final
@cython.cclass
class Disturbance:
    """Disturbances of a bus. Bits are counted since power-up.

    `next_bit`: the next bit that is hit as far as known, NEVER when none is. `frames_left`: number of coming frames
    that are hit, at `position` each, negative: in their middle. `noise`: the RandomStream of the bit error rate.
    `misread`: bits that single nodes sample wrongly, as (bit, node), of which the first is `next_misread`.

    On a CAN FD bus bits are ticks. A chosen bit of a frame is inverted from its start to its end, one chosen by time
    for a nominal bit from that time on; noise inverts the level for a data bit at a time, so that each bit, of either
    rate, is sampled wrongly at the given rate. `span`: the ticks of a bit chosen by time; `spans`: others, by the first
    tick; `step`: those of a data bit. A single node misreads its next sample from the given tick on.
    """

    next_bit: cython.longlong
    frames_left: cython.longlong
    position: cython.longlong
    planned_bits: list
    noise: "RandomStream"
    bit_error_rate: cython.double
    next_noise_bit: cython.longlong
    next_misread: cython.longlong
    misread: list
    span: cython.longlong
    spans: dict
    step: cython.longlong

    def __init__(self, noise) -> None:
        self.noise = noise
        self.span = 1
        self.spans = {}
        self.step = 1
        self.frames_left = 0
        self.position = -1
        self.planned_bits = []
        self.bit_error_rate = 0.0
        self.next_noise_bit = NEVER
        self.misread = []
        self.next_misread = NEVER
        self._aim()

    def set_timing(self, span, step) -> None:
        """Ticks of a nominal bit and of a data bit."""
        self.span = span
        self.step = step

    def hit_node(self, bit, node) -> None:
        """`node` samples the opposite of what is on the bus in a bit that has not passed."""
        self.misread.append((bit, node))
        self.misread.sort()
        self.next_misread = self.misread[0][0]

    @cython.cfunc
    def misreading(self, bit: cython.longlong) -> cython.longlong:
        """Nodes that sample `bit` wrongly, as bits by node number; entries up to there are removed."""
        nodes: cython.longlong = 0
        one: cython.longlong = 1
        node: cython.longlong
        while self.misread and self.misread[0][0] <= bit:
            at, node = self.misread.pop(0)
            if at == bit:
                nodes |= one << node
        self.next_misread = self.misread[0][0] if self.misread else NEVER
        return nodes

    def hit_frames(self, count, position) -> None:
        """Hit the next `count` frames at bit `position`, negative: in their middle."""
        self.frames_left = count
        self.position = position

    def hit_bit(self, bit) -> None:
        """Hit one bit, which is not decided yet."""
        self.planned_bits.append(bit)
        self.planned_bits.sort()
        self._aim()

    def set_rate(self, rate, bit) -> None:
        """Hit each bit after `bit` with probability `rate`."""
        self.bit_error_rate = rate
        self.next_noise_bit = bit
        self._draw_noise()
        self._aim()

    @cython.cfunc
    def misreads(self, tick: cython.longlong, node: cython.longlong) -> cython.bint:
        """Whether `node` samples wrongly at `tick`; that entry is removed."""
        for entry in self.misread:
            if entry[0] > tick:
                break
            if entry[1] == node:
                self.misread.remove(entry)
                self.next_misread = self.misread[0][0] if self.misread else NEVER
                return True
        return False

    def take_strike(self) -> int:
        """Advance past the next strike; returns the tick at which it ends."""
        first: cython.longlong = self.next_bit
        planned: cython.bint = bool(self.planned_bits) and self.planned_bits[0] == first
        span = self.spans.pop(first, self.span) if planned else self.step
        self.strike(first)
        return first + span

    @cython.cfunc
    def _aim(self) -> None:
        planned: cython.longlong = self.planned_bits[0] if self.planned_bits else NEVER
        self.next_bit = min(planned, self.next_noise_bit)

    @cython.cfunc
    def _draw_noise(self) -> None:
        """The next disturbed bit: distances between them are exponential with mean 1 / rate."""
        u: cython.double
        distance: cython.double
        if self.bit_error_rate > 0.0:
            u = self.noise.uniform()
            distance = -log(1.0 - u) / self.bit_error_rate
            self.next_noise_bit += (1 + int(distance)) * self.step
        else:
            self.next_noise_bit = NEVER

    @cython.cfunc
    def meet_frame(self, start: cython.longlong, bits: cython.longlong, flags: cython.longlong) -> None:
        """Plan the bit to hit in a frame of that many bits from bit `start` on, if the frame is one to be hit."""
        if self.frames_left > 0:
            self.hit_bit(start + self.place_in(bits, flags))

    @cython.cfunc
    def place_in(self, bits: cython.longlong, flags: cython.longlong) -> cython.longlong:
        """The place to hit in the frame of that many bits which begins now."""
        middle: cython.longlong = (bits - 1) // 2
        self.frames_left -= 1
        if self.position >= 0:
            return self.position
        # after the arbitration field, so that it is an error of the sender
        return max(middle, EXTENDED_ARBITRATION_END if flags & FLAG_EXTENDED else ARBITRATION_END)

    @cython.cfunc
    def strike(self, bit: cython.longlong) -> None:
        """Advance past `bit`, which is hit."""
        while self.planned_bits and self.planned_bits[0] <= bit:
            self.planned_bits.pop(0)
        if self.next_noise_bit <= bit:
            self.next_noise_bit = bit
            self._draw_noise()
        self._aim()
