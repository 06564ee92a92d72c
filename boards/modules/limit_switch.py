# cython: boundscheck=False, wraparound=False
# (pins are those of the table in motor_board.py)
"""Limit switches on pins, active low, with the same debouncing as the feet (facts network-and-boards 4.9)."""

import cython

from boards.modules.foot_contact import Debounce
from firmware_sim.peripherals.gpio import Gpio

EQUAL_SAMPLES = 3  # the firmware's limit of 2 repetitions: 1.5 ms


class LimitSwitch:
    """One switch on `pin`; `switch.state` is 1 when closed. The pin has a pull-up: unconnected reads open."""

    def __init__(self, gpio: Gpio, pin) -> None:
        self.gpio = gpio
        self.pin = pin
        self.gpio.levels[pin] = 1
        self.switch = Debounce(EQUAL_SAMPLES)

    def sample(self) -> cython.void:
        """One reading per slot."""
        closed: cython.longlong = 1 - self.gpio.levels[self.pin]
        if closed != self.switch.settled:
            self.switch.sample(closed)
