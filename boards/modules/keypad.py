"""Six keys, active high, not debounced. Source: robot.md N4.11."""

import cython

from ranger_sim.boards.modules.front_panel import KEY_PINS
from ranger_sim.datatable.generated import errors
from ranger_sim.firmware_sim.peripherals.gpio import Gpio


@cython.cclass
class Keypad:
    """Levels of the keys through `gpio.level(pin)`; `report(code)` receives BUTTON_OOB."""

    gpio: Gpio
    pins: cython.longlong[6]
    report: object
    code_index: cython.longlong

    def __init__(self, gpio: Gpio, report) -> None:
        self.gpio = gpio
        self.pins = list(KEY_PINS)
        self.report = report
        self.code_index = errors.BUTTON_OOB

    @cython.ccall
    def pressed(self, key: cython.longlong) -> cython.bint:
        """True while key 0-5 is down; another number is an error and counts as up."""
        if key < 0 or key > 5:
            self.report(self.code_index)
            return False
        return self.gpio.level(self.pins[key]) != 0

    @cython.ccall
    def buttons(self) -> cython.longlong:
        """Bit mask of UI_BUTTONS: a key that is held sets the bit of its number."""
        mask: cython.longlong = 0
        i: cython.longlong
        for i in range(6):
            if self.gpio.level(self.pins[i]):
                mask |= 1 << i
        return mask
