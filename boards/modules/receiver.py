"""Where a received frame goes: objects with one method, `deliver`, listed by identifier in the CAN link."""

import cython

if not cython.compiled:
    from ranger_sim.foundation.numbers import fixed_of_float, float_of_word, wrap_i32


class Receiver:
    """Base of everything that takes the two words of a frame (0 ... 2^32-1 each). `frames`: how many came.

    `cycles`: what it takes more than the time frame's.
    """

    def __init__(self, cycles=0) -> None:
        self.frames = 0
        self.cycles = cycles

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        """A frame of this identifier was received. Satellites ignore the time word of commands."""
        self.frames += 1


class FloatReceiver(Receiver):
    """Keeps a float value: `value` as sent, `fixed` the same in 16.16 (truncated)."""

    def __init__(self) -> None:
        Receiver.__init__(self)
        self.value = 0.0
        self.fixed = 0

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        self.frames += 1
        self.value = float_of_word(value_word)
        self.fixed = fixed_of_float(self.value)


class IntReceiver(Receiver):
    """Keeps a whole number: `value` is the signed 32-bit word."""

    def __init__(self) -> None:
        Receiver.__init__(self)
        self.value = 0

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        self.frames += 1
        self.value = wrap_i32(value_word)


class Ignored(Receiver):
    """Takes a frame and does nothing with it (the dummy setter of the firmware)."""
