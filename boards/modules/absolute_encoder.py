"""Absolute joint encoder AM8192B: 13 bits per turn, its spike limiter, zero and sign
(robot.md N4.7)."""

from typing import Final

import cython

from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.foundation.numbers import fixed_of_float, float32, float_of_word, word_of_float

WORD_MASK: Final = 0x1FFF  # 13 bits
COUNTS_PER_TURN: Final = 8192
SLOTS_PER_MINUTE: Final = 120_000
SPARE_COUNTS: Final = 5  # that a step may be larger than the fastest joint's

RAD_PER_COUNT = float_of_word(word_of_float(0.0007669922))  # a single float; 2 pi / 8192 would be 0.00076699039


@cython.final
@cython.cclass
class AbsoluteEncoder:
    """Angle of a joint. `zero`: raw count at angle 0; `sign`: of the mounting; `rpm`: fastest joint speed.

    `counts` is sign x (value - zero) without any wrap-around; `radians` the same as a single float, `angle` that in rad
    x 65536, truncated toward zero. `value` is what the spike limiter let through, 0 before the first reading.
    """

    value: cython.longlong
    counts: cython.longlong
    angle: cython.longlong
    largest_step: cython.longlong
    sign: cython.longlong
    zero: cython.longlong
    radians: cython.double
    rad_per_count: cython.double
    errors: ErrorModule
    spike_code: cython.longlong

    def __init__(self, zero, sign, rpm, errors: ErrorModule, spike_code) -> None:
        self.zero = zero
        self.sign = sign
        self.largest_step = rpm * COUNTS_PER_TURN // SLOTS_PER_MINUTE + SPARE_COUNTS
        self.errors = errors
        self.spike_code = spike_code
        self.value = 0
        self.counts = 0
        self.rad_per_count = RAD_PER_COUNT
        self.radians = 0.0
        self.angle = 0

    @cython.ccall
    def accept(self, word: cython.longlong) -> cython.void:
        """A transfer of the serial interface ended: keep its low 13 bits, limited in their step."""
        new: cython.longlong = word & WORD_MASK
        before: cython.longlong = self.value
        if before != 0:
            if new == before:
                return  # as before, with all that follows from it
            if new > before + self.largest_step:
                new = before + self.largest_step
                self.errors.report(self.spike_code)
            elif new < before - self.largest_step:
                new = before - self.largest_step
                self.errors.report(self.spike_code)
        self.value = new
        self.counts = self.sign * (new - self.zero)
        self.radians = float32(self.counts * self.rad_per_count)
        self.angle = fixed_of_float(self.radians)

    @cython.ccall
    @cython.exceptval(check=False)
    def angle_rad(self) -> cython.double:
        """Angle in rad, as published."""
        return self.radians
