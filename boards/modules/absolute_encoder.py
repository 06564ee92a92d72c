"""Absolute joint encoder AM8192B: 13 bits per turn, its spike limiter, zero and sign
(robot.md N4.7)."""

import cython

from ranger_sim.boards.modules.error_module import ErrorModule

if not cython.compiled:
    # RAD_PER_COUNT in 0.32 fixed point, x 2^32, so that the truncation stays below one 16.16 step.
    RAD_PER_COUNT_SHIFTED = 3294206
    WORD_MASK = 0x1FFF  # 13 bits
    COUNTS_PER_TURN = 8192
    SLOTS_PER_MINUTE = 120_000
    SPARE_COUNTS = 5  # that a step may be larger than the fastest joint's

RAD_PER_COUNT = 0.0007669922  # as in the firmware; 2 pi / 8192 would be 0.00076699039


class AbsoluteEncoder:
    """Angle of a joint. `zero`: raw count at angle 0; `sign`: of the mounting; `rpm`: fastest joint speed.

    `counts` is sign x (value - zero) without any wrap-around; `angle` the same in rad x 65536. `value` is
    what the spike limiter let through, 0 before the first reading.
    """

    def __init__(self, zero, sign, rpm, errors: ErrorModule, spike_code) -> None:
        self.zero = zero
        self.sign = sign
        self.largest_step = rpm * COUNTS_PER_TURN // SLOTS_PER_MINUTE + SPARE_COUNTS
        self.errors = errors
        self.spike_code = spike_code
        self.value = 0
        self.counts = 0
        self.angle = 0

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
        self.angle = (self.counts * RAD_PER_COUNT_SHIFTED) >> 16

    def angle_rad(self) -> cython.double:
        """Angle in rad as it is published."""
        return self.counts * RAD_PER_COUNT
