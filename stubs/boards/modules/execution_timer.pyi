# Generated from boards/modules/execution_timer.py and boards/modules/execution_timer.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from typing import final

ANEW_MASK: int
SECONDS_PER_CYCLE: float

@final
class ExecutionTimer:
    chip: Microcontroller
    time: NetworkTime
    seconds_per_cycle: float
    longest: int
    longest_ever: int
    def __init__(self, chip: Microcontroller, time: NetworkTime) -> None: ...
    def record(self) -> None: ...
    def seconds(self) -> float: ...
    def longest_seconds(self) -> float: ...
