# cython: boundscheck=False, wraparound=False
# (pins are those of the boards' tables, 0 ... 63)
"""General-purpose pins: P0.0 ... P0.31 are pins 0 ... 31, P1.0 ... P1.31 are pins 32 ... 63.

Inputs follow PIN_EDGE messages (the chip keeps their levels); a change of an output sends PIN_OUTPUT. Other devices of
the board at a pin see both (`Chip.followers`).
A pin's level at a stamp is that of its last message: a partner pin without its own messages is as old as
the last edge that reported it.
"""

import cython

from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.foundation.events import PIN_OUTPUT


def p0(bit) -> int:
    """Pin number of P0.`bit`."""
    return bit


def p1(bit) -> int:
    """Pin number of P1.`bit`."""
    return 32 + bit


@cython.cclass
class Gpio(Peripheral):
    """The two ports of a chip, whose levels are `chip.pins`. `outputs`, per pin: 1 once it was written."""

    outputs: cython.longlong[64]

    def __init__(self, chip) -> None:
        Peripheral.__init__(self, chip)
        self.outputs = [0] * 64

    @cython.ccall
    def level(self, pin: cython.longlong) -> cython.longlong:
        """0 or 1, as the pin is now."""
        return self.chip.pins[pin]

    @cython.ccall
    def write(self, pin: cython.longlong, level: cython.longlong) -> None:
        """Drive an output; a change is sent outside as PIN_OUTPUT at `now`."""
        if self.chip.pins[pin] != level or self.outputs[pin] == 0:
            self._drive(pin, level)

    @cython.ccall
    def toggle(self, pin: cython.longlong) -> None:
        """Invert an output."""
        self._drive(pin, 1 - self.chip.pins[pin])

    @cython.cfunc
    def _drive(self, pin: cython.longlong, level: cython.longlong) -> cython.int:
        self.outputs[pin] = 1
        self.chip.pins[pin] = level
        self.chip.outbox.push(self.chip.now, 0, PIN_OUTPUT, pin, level)
        if self.chip.followers[pin] is not None:
            cython.cast(Peripheral, self.chip.followers[pin]).on_level(pin, level)
        return 0

    @cython.ccall
    def IOSET(self, port: cython.longlong, mask: cython.longlong) -> None:
        """Set the pins of `mask` (bit 0 = Px.0) of port 0 or 1."""
        bit: cython.longlong
        for bit in range(32):
            if mask >> bit & 1:
                self.write(port * 32 + bit, 1)

    @cython.ccall
    def IOCLR(self, port: cython.longlong, mask: cython.longlong) -> None:
        """Clear the pins of `mask` of port 0 or 1."""
        bit: cython.longlong
        for bit in range(32):
            if mask >> bit & 1:
                self.write(port * 32 + bit, 0)

    @cython.ccall
    def IOPIN(self, port: cython.longlong) -> cython.longlong:
        """The 32 levels of a port as a word."""
        bit: cython.longlong
        word: cython.longlong = 0
        for bit in range(32):
            word |= self.chip.pins[port * 32 + bit] << bit
        return word
