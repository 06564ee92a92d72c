# Generated from boards/modules/current_control.py and boards/modules/current_control.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.mcu_led import McuLed
from ranger_sim.boards.modules.motor_limits import MotorLimits
from ranger_sim.boards.modules.motor_output import MotorOutput
from typing import Any
from typing import final

START_CALLS: int
ONE: int
INTEGRAL_GAIN: int
PROPORTIONAL_GAIN: int

@final
class CurrentControl:
    limits: MotorLimits
    output: MotorOutput
    block_positive: bool
    block_negative: bool
    calls: int
    integral: int
    integral_limit: int
    proportional_gain: int
    integral_gain: int
    duty: int
    leds: McuLed
    errors: ErrorModule
    code_saturated: int
    code_sum: int
    code_duty: int
    code_stopped: int
    def __init__(self, limits: MotorLimits, output: MotorOutput, leds: McuLed, errors: ErrorModule, codes: Any, proportional_gain: Any = ..., integral_gain: Any = ...) -> None: ...
    def supervise(self, current: int) -> bool: ...
    def update(self, target: int, current: int) -> None: ...
