# Generated from boards/modules/keypad.py and boards/modules/keypad.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
from typing import Any

class Keypad:
    gpio: Gpio
    pins: MutableSequence[int]
    report: Any
    code_index: int
    def __init__(self, gpio: Gpio, report: Any) -> None: ...
    def pressed(self, key: int) -> bool: ...
    def buttons(self) -> int: ...
