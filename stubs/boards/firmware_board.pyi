# Generated from boards/firmware_board.py and boards/firmware_board.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.can_link import CanLink
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.execution_timer import ExecutionTimer
from ranger_sim.boards.modules.mcu_led import Heartbeat
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller import CanController
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
from ranger_sim.firmware_sim.scheduler import Schedule
from ranger_sim.firmware_sim.scheduler import Task
from typing import Any

ALL_CAN_INTERRUPTS: Any
TICK_CYCLES: Any
CAN_RECEIVE_SLOT: int

class FirmwareBoard(Microcontroller):
    errors: ErrorModule
    time: NetworkTime
    errors_one_late: bool
    error_before: int
    table: Any
    quirks: Any
    def __init__(self, table: Any, crystal: Any, quirks: Any, one_late: bool = False) -> None: ...
    def schedule(self) -> Schedule: ...
    def report(self, code: int) -> None: ...
    def note_overrun(self) -> None: ...
    def note_limit(self, task: Task) -> None: ...
    def note_near_limit(self) -> None: ...

class SatelliteBoard(FirmwareBoard):
    can: CanLink
    can_controller: CanController
    execution: ExecutionTimer
    heartbeat: Heartbeat
    gpio: Gpio
    def __init__(self, table: Any, crystal: Any, quirks: Any, error_slot: Any, interrupts: Any = ...) -> None: ...
    def counters(self) -> Any: ...
