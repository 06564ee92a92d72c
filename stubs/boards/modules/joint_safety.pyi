# Generated from boards/modules/joint_safety.py and boards/modules/joint_safety.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.absolute_encoder import AbsoluteEncoder
from ranger_sim.boards.modules.current_control import CurrentControl
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.limit_switch import LimitSwitch
from ranger_sim.boards.modules.mcu_led import McuLed
from ranger_sim.boards.modules.quadrature_decoder import QuadratureDecoder
from typing import final

HIP_LIMIT_COUNTS: int
FLASH_MS: int
ANKLE_LOW_RAD: float
ANKLE_HIGH_RAD: float
CABLE_STRETCH_RAD: float

@final
class HipSafety:
    encoder: AbsoluteEncoder
    control: CurrentControl
    leds: McuLed
    def __init__(self, encoder: AbsoluteEncoder, control: CurrentControl, leds: McuLed) -> None: ...
    def check(self) -> None: ...

@final
class AnkleSafety:
    encoder: AbsoluteEncoder
    motor: QuadratureDecoder
    left: LimitSwitch
    right: LimitSwitch
    control: CurrentControl
    leds: McuLed
    errors: ErrorModule
    low: float
    high: float
    stretch: float
    code_switch: int
    code_stretch: int
    code_low: int
    code_high: int
    def __init__(self, encoder: AbsoluteEncoder, motor: QuadratureDecoder, left: LimitSwitch, right: LimitSwitch, control: CurrentControl, leds: McuLed, errors: ErrorModule, code_switch: int, code_stretch: int, code_low: int, code_high: int) -> None: ...
    def check(self) -> None: ...
