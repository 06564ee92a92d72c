# Generated from boards/modules/mcu_led.py and boards/modules/mcu_led.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
from typing import Any
from typing import final

GREEN: int
RED: int
BLUE: int
FIRST_PIN: int
HEARTBEAT_MS: int
HEARTBEAT_BIT: int
PINS: dict[str, Any]

class McuLed:
    lit: int
    remaining_green: int
    remaining_red: int
    remaining_blue: int
    gpio: Gpio
    slots_per_ms: float
    def __init__(self, gpio: Gpio, slot_us: Any) -> None: ...
    def pin(self, led: int) -> int: ...
    def set_remaining(self, led: int, slots: int) -> None: ...
    def flash(self, led: int, ms: int) -> None: ...
    def on(self, led: int) -> None: ...
    def off(self, led: int) -> None: ...
    def update(self) -> None: ...

@final
class Heartbeat(McuLed):
    time: NetworkTime
    last_bit: int
    beats: int
    def __init__(self, time: NetworkTime, gpio: Gpio, slot_us: Any) -> None: ...
    def beat(self) -> None: ...
