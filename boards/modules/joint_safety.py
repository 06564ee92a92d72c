"""Joint limits that close one direction of the motor (robot.md N4.8)."""

from typing import Final

import cython

from ranger_sim.boards.modules.absolute_encoder import AbsoluteEncoder
from ranger_sim.boards.modules.current_control import CurrentControl
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.limit_switch import LimitSwitch
from ranger_sim.boards.modules.mcu_led import GREEN, RED, McuLed
from ranger_sim.boards.modules.quadrature_decoder import QuadratureDecoder
from ranger_sim.foundation.numbers import float32

HIP_LIMIT_COUNTS: Final = 800  # 0.614 rad
FLASH_MS: Final = 100

ANKLE_LOW_RAD = 0.2
ANKLE_HIGH_RAD = 2.9
CABLE_STRETCH_RAD = 0.3  # joint ahead of the motor by this: the cable has slipped or torn


@cython.final
@cython.cclass
class HipSafety:
    """Beyond +800 counts positive current is blocked (red LED), beyond -800 negative current (green LED)."""

    encoder: AbsoluteEncoder
    control: CurrentControl
    leds: McuLed

    def __init__(self, encoder: AbsoluteEncoder, control: CurrentControl, leds: McuLed) -> None:
        self.encoder = encoder
        self.control = control
        self.leds = leds

    def check(self) -> None:
        """Slot task."""
        counts: cython.longlong = self.encoder.counts
        high: cython.bint = counts > HIP_LIMIT_COUNTS
        low: cython.bint = counts < -HIP_LIMIT_COUNTS
        if high:
            self.leds.flash(RED, FLASH_MS)
        elif low:
            self.leds.flash(GREEN, FLASH_MS)
        self.control.block_positive = high
        self.control.block_negative = low


@cython.final
@cython.cclass
class AnkleSafety:
    """Limit switches, cable stretch and the low end block negative current, the high end positive current.

    ANKL_LO is common in a walk, and not a difference between the two boards if only one raises it: the record
    walk's flip-up target is 0.2 rad, the very bound checked here, so a raised foot comes to rest on either side
    of it by friction and by the zero error of its current sensor. That error has the mounting's sign and shifts
    the rest by 0.05 A / 1.5 A/rad = 0.033 rad: with our 0.05 A the inner ankles rest at 0.18 rad and the outer
    ones at 0.22 rad; with 0 A both boards raise it alike, with -0.05 A only the outer one does (measured). The
    2015 records of the robot show the same: blocked below 0.2 rad, an ankle does not quite reach that target.
    """

    encoder: AbsoluteEncoder
    motor: QuadratureDecoder
    left: LimitSwitch
    right: LimitSwitch
    control: CurrentControl
    leds: McuLed
    errors: ErrorModule
    low: cython.double
    high: cython.double
    stretch: cython.double
    code_switch: cython.longlong
    code_stretch: cython.longlong
    code_low: cython.longlong
    code_high: cython.longlong

    def __init__(
        self,
        encoder: AbsoluteEncoder,
        motor: QuadratureDecoder,
        left: LimitSwitch,
        right: LimitSwitch,
        control: CurrentControl,
        leds: McuLed,
        errors: ErrorModule,
        code_switch,
        code_stretch,
        code_low,
        code_high,
    ) -> None:
        self.encoder = encoder
        self.motor = motor
        self.left = left
        self.right = right
        self.control = control
        self.leds = leds
        self.errors = errors
        self.code_switch = code_switch
        self.code_stretch = code_stretch
        self.code_low = code_low
        self.code_high = code_high
        self.low = ANKLE_LOW_RAD
        self.high = ANKLE_HIGH_RAD
        self.stretch = CABLE_STRETCH_RAD

    def check(self) -> None:
        """Slot task."""
        angle: cython.double = self.encoder.radians
        negative: cython.bint = False
        positive: cython.bint = False
        if self.left.state or self.right.state:
            negative = True
            self.errors.report(self.code_switch)
        if float32(angle - self.motor.position_rad()) > self.stretch:
            negative = True
            self.errors.report(self.code_stretch)
        if angle < self.low:
            negative = True
            self.errors.report(self.code_low)
        if angle > self.high:
            positive = True
            self.errors.report(self.code_high)
        if negative or positive:
            self.leds.flash(RED, FLASH_MS)
        self.control.block_negative = negative
        self.control.block_positive = positive
