# cython: boundscheck=False, wraparound=False
# (pins are those of the table in motor_board.py)
"""Limit switches on pins, active low, with the same debouncing as the feet (robot.md N4.9)."""

import cython

from ranger_sim.boards.modules.foot_contact import Debounce
from ranger_sim.firmware_sim.microcontroller import Microcontroller

EQUAL_SAMPLES = 3  # the firmware's limit of 2 repetitions: 1.5 ms


@cython.final
@cython.cclass
class LimitSwitch(Debounce):
    """One switch on `pin`; `state` is 1 when closed. The pin has a pull-up: unconnected reads open."""

    chip: Microcontroller
    pin: cython.longlong

    def __init__(self, chip: Microcontroller, pin) -> None:
        Debounce.__init__(self, EQUAL_SAMPLES)
        self.chip = chip
        self.pin = pin
        chip.pins[pin] = 1

    @cython.ccall
    def read(self) -> cython.void:
        """One reading per slot."""
        closed: cython.longlong = 1 - self.chip.pins[self.pin]
        if closed != self.settled:
            self.sample(closed)
