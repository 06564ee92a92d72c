# Generated from firmware_sim/alarm.py and firmware_sim/alarm.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.firmware_sim.chip import Chip
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import InterruptSource
from typing import Any
from typing import final

@final
class Alarm:
    chip: Chip
    owner: Peripheral
    number: int
    place: int
    time: int
    def __init__(self, chip: Chip, owner: Peripheral, number: int, place: int) -> None: ...
    def set(self, time: int) -> int: ...

@final
class SlotTimer(Peripheral):
    alarm: Alarm
    def __init__(self, chip: Any) -> None: ...
    def on_alarm(self, alarm: int, time: int) -> InterruptSource | None: ...
