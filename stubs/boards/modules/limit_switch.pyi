# Generated from boards/modules/limit_switch.py and boards/modules/limit_switch.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.foot_contact import Debounce
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from typing import final

EQUAL_SAMPLES: int

@final
class LimitSwitch(Debounce):
    chip: Microcontroller
    pin: int
    def __init__(self, chip: Microcontroller, pin: int) -> None: ...
    def read(self) -> None: ...
