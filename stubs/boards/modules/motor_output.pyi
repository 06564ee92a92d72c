# Generated from boards/modules/motor_output.py and boards/modules/motor_output.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.receiver import IntReceiver
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
from ranger_sim.firmware_sim.peripherals.pwm import Pwm
from typing import Any
from typing import final

PERIOD_COUNTS: int
SLEEP: int
SHUTDOWN: int
STOPPED: int
OFF_UNLESS_0: int
PINS: dict[str, Any]

@final
class OffRequest(IntReceiver):
    output: MotorOutput
    bit: int
    def __init__(self, output: MotorOutput, bit: int) -> None: ...
    def deliver(self, value_word: int, time_word: int) -> None: ...

@final
class MotorOutput:
    second_pattern: bool
    off: int
    watchdog_pin: int
    low_side_2_pin: int
    low_side_6_pin: int
    gpio: Gpio
    pwm: Pwm
    sign: int
    largest: int
    offset: int
    low_side: int
    duty: int
    sleep: OffRequest
    shutdown: OffRequest
    def __init__(self, gpio: Gpio, pwm: Pwm, sign: int, largest: int, offset: int) -> None: ...
    def feed_watchdog(self) -> None: ...
    def enable_low_side(self, on: int) -> None: ...
    def write(self, duty: int) -> None: ...
