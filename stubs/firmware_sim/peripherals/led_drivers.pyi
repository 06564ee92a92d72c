# Generated from firmware_sim/peripherals/led_drivers.py and firmware_sim/peripherals/led_drivers.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.peripherals.ssp import SspDevice
from typing import Any
from typing import final

PORTS: int
REGISTERS: int
MOST_DEVICES: int
WORD_BITS: int
READ: int
CONFIGURATION: int
RUN: int
LOW_LOGIC: int
HIGH_LOGIC: int
LOW: int
OPEN: int
GROUPS: dict[int, tuple[int, ...]]
ALL_GROUPS_BELOW: int

@final
class LedDrivers(SspDevice):
    select_pin: int
    count: int
    shift: int
    writes: int
    selected: bool
    registers: MutableSequence[int]
    def __init__(self, chip: Any, select_pin: int, count: int = 1) -> None: ...
    def exchange(self, word: int, time: int) -> int: ...
    def on_select(self, level: int) -> bool: ...
    def level(self, device: int, port: int) -> int: ...
