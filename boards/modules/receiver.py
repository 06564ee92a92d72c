"""Receivers of frames: objects with one method, `deliver`, listed by identifier in the CAN link."""

import cython

from ranger_sim.foundation.numbers import fixed_of_float, float_of_word, wrap_i32


@cython.cclass
class Receiver:
    """Base of everything that takes the two words of a frame (0 ... 2^32-1 each). `frames`: number received.

    `cycles`: those in addition to the time frame's.
    """

    frames: cython.longlong
    cycles: cython.longlong

    def __init__(self, cycles=0) -> None:
        self.frames = 0
        self.cycles = cycles

    @cython.ccall
    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        """Take a frame of this identifier. Satellites ignore the time word of commands."""
        self.frames += 1


@cython.final
@cython.cclass
class FloatReceiver(Receiver):
    """Keeps a float value: `value` as sent, `fixed` the same in 16.16 (truncated)."""

    value: cython.double
    fixed: cython.longlong

    def __init__(self) -> None:
        Receiver.__init__(self)
        self.value = 0.0
        self.fixed = 0

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        self.frames += 1
        self.value = float_of_word(value_word)
        self.fixed = fixed_of_float(self.value)


@cython.cclass
class IntReceiver(Receiver):
    """Keeps a whole number: `value` is the signed 32-bit word."""

    value: cython.longlong

    def __init__(self) -> None:
        Receiver.__init__(self)
        self.value = 0

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        self.frames += 1
        self.value = wrap_i32(value_word)


@cython.final
@cython.cclass
class Ignored(Receiver):
    """Takes a frame and does nothing with it (the dummy setter of the firmware)."""
