# Generated from harness/wiring/imu_wire.py and harness/wiring/imu_wire.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.foundation.events import EventQueue
from ranger_sim.harness.step_watch import SerialDevice
from ranger_sim.plant.sensors.imu import Imu
from typing import Any
from typing import final

MESSAGE_BYTES: int
WORD_BYTES: int
PAUSE_NS: int

@final
class ImuWire(SerialDevice):
    imu: Imu
    inbox: EventQueue
    uart: int
    tap: Any
    plugged: bool
    def __init__(self, imu: Imu, board: Any, uart: int) -> None: ...
    def unplug(self) -> None: ...
    def from_board(self, time: Any, byte: Any, count: Any, data: Any) -> None: ...
    def deliver(self) -> Any: ...
