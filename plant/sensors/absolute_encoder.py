"""The absolute joint encoder AM8192B as a device: a 13-bit word for an angle (appendix 3.8;
robot.md N4.7).

word = zero + sign x 8192 / (2 pi) x (angle + errors), to the nearest count, modulo 8192. `zero` is the word at
joint angle 0, `sign` the mounting. Zeros of the robot: hip 4590 (+), outer ankle 6562 (-), inner ankle 1572 (+).
"""

from typing import Final

import cython
from cython.cimports.libc.math import exp, sin

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import ModelError
from ranger_sim.plant.sensors.noise import NoiseSource

WORD_BITS: Final = 13
COUNTS_PER_TURN: Final = 8192

PI = 3.141592653589793


@cython.final
@cython.cclass
class AbsoluteEncoder:
    """One device. `noise_counts`: standard deviation before rounding; `bit_flip`: probability per word that one
    of its bits is read wrong (the long unshielded cable of appendix 3.8; 0 by default, because no source gives a rate).
    """

    # fields read for every word come first, next to each other
    noise: NoiseSource
    scale: cython.double
    offset_rad: cython.double
    lag_s: cython.double
    eccentricity_1: cython.double
    eccentricity_2: cython.double
    counts_per_rad: cython.double
    noise_counts: cython.double
    bit_flip: cython.double
    zero: cython.longlong
    phase_1: cython.double
    phase_2: cython.double
    angle: cython.double
    started: cython.bint
    flips: RandomStream
    sign: cython.longlong
    flipped: cython.longlong
    name: str

    def __init__(self, name, zero, sign=1, noise_counts=0.3, bit_flip=0.0, seed=0) -> None:
        if not 0 <= zero < COUNTS_PER_TURN or sign not in (-1, 1):
            raise ModelError(f"absolute encoder {name}: zero {zero} (0 ... 8191), sign {sign} (-1, 1) are impossible")
        if noise_counts < 0.0 or not 0.0 <= bit_flip <= 1.0:
            raise ModelError(
                f"absolute encoder {name}: noise_counts {noise_counts} or bit_flip {bit_flip} is impossible"
            )
        self.name = name
        self.zero = zero
        self.sign = sign
        self.noise_counts = noise_counts
        self.bit_flip = bit_flip
        self.noise = NoiseSource(seed, f"absolute encoder {name} noise")
        self.flips = RandomStream(seed, f"absolute encoder {name} flips")
        self.counts_per_rad = sign * COUNTS_PER_TURN / (2.0 * PI)
        self.scale = 1.0
        self.offset_rad = 0.0
        self.lag_s = 0.0
        self.eccentricity_1 = 0.0
        self.phase_1 = 0.0
        self.eccentricity_2 = 0.0
        self.phase_2 = 0.0
        self.angle = 0.0
        self.started = False
        self.flipped = 0

    @cython.ccall
    @cython.exceptval(check=False)
    def word(self, angle: cython.double, h: cython.double = 0.0) -> cython.longlong:
        """The device's word at a joint angle (rad), `h` seconds after the word before (only a lag needs it)."""
        x: cython.double = self.scale * angle + self.offset_rad
        n: cython.longlong
        if self.lag_s > 0.0:
            if self.started:
                x = self.angle + (x - self.angle) * (1.0 - exp(-h / self.lag_s))
            self.started = True
            self.angle = x
        if self.eccentricity_1 != 0.0 or self.eccentricity_2 != 0.0:
            x += self.eccentricity_1 * sin(x + self.phase_1) + self.eccentricity_2 * sin(2.0 * x + self.phase_2)
        x = self.zero + self.counts_per_rad * x + 0.5
        if self.noise_counts > 0.0:
            x += self.noise_counts * self.noise.normal()
        n = int(x)
        if x < n:
            n -= 1
        n &= COUNTS_PER_TURN - 1
        if self.bit_flip > 0.0 and self.flips.uniform() < self.bit_flip:
            n ^= 1 << self.flips.integer(WORD_BITS)
            self.flipped += 1
        return n
