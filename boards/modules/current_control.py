"""The inner loop: proportional-integral control of the motor current, 2 kHz, duty in counts of 600
(appendix 4.7; robot.md N4.3)."""

from typing import Final

import cython

from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.mcu_led import GREEN, McuLed
from ranger_sim.boards.modules.motor_limits import MotorLimits
from ranger_sim.boards.modules.motor_output import STOPPED, MotorOutput

START_CALLS: Final = 2  # the first calls only feed the watchdog
ONE: Final = 65536  # in 16.16

# Counts per A and sample, all four boards (robot.md N4.2). The current settles within one sample, so the motor is a
# gain of 1/31 A per count (1.34 ohm at 25.9 V): the integral alone has its pole at 1 - 20/31 = 0.35.
INTEGRAL_GAIN = 20
# Chosen by us: a fifth of the integral gain, "with the emphasis on the integral" (appendix 4.7). Poles of
# z^2 + (a + b - 1) z - a with a = 4/31, b = 20/31: 0.49 and -0.26; at 1.0 ohm and 28 V (21 counts/A): 0.37, -0.51.
PROPORTIONAL_GAIN = 4


@cython.final
@cython.cclass
class CurrentControl:
    """Current loop of one motor. Gains in counts per A; 16.16 inside. `duty` is the last sum, in counts.

    `block_positive`, `block_negative`: directions closed by the joint's safety check.
    """

    limits: MotorLimits
    output: MotorOutput
    block_positive: cython.bint
    block_negative: cython.bint
    calls: cython.longlong
    integral: cython.longlong
    integral_limit: cython.longlong
    proportional_gain: cython.longlong
    integral_gain: cython.longlong
    duty: cython.longlong
    leds: McuLed
    errors: ErrorModule
    code_saturated: cython.longlong
    code_sum: cython.longlong
    code_duty: cython.longlong
    code_stopped: cython.longlong

    def __init__(
        self,
        limits: MotorLimits,
        output: MotorOutput,
        leds: McuLed,
        errors: ErrorModule,
        codes,
        proportional_gain=PROPORTIONAL_GAIN,
        integral_gain=INTEGRAL_GAIN,
    ) -> None:
        self.limits = limits
        self.output = output
        self.leds = leds
        self.errors = errors
        self.code_saturated = codes.MC_INTEG_SATUR
        self.code_sum = codes.MC_FIXED_LIMIT
        self.code_duty = codes.MC_PWM_LIMIT
        self.code_stopped = codes.MC_NOT_RUNNING
        self.proportional_gain = proportional_gain * ONE
        self.integral_gain = integral_gain * ONE
        self.integral_limit = output.largest * ONE // integral_gain
        self.integral = 0  # A samples x 65536
        self.duty = 0
        self.calls = 0
        self.block_positive = False
        self.block_negative = False

    @cython.ccall
    def supervise(self, current: cython.longlong) -> cython.bint:
        """First part of a sample: feed the watchdog, advance the monitors, switch the motor off or on.

        False in the first two calls, which do nothing else than feed.
        """
        self.output.feed_watchdog()
        if self.calls < START_CALLS:
            self.calls += 1
            return False
        if self.limits.monitor(current):
            if self.output.off & STOPPED == 0:
                self.output.off |= STOPPED
                self.leds.on(GREEN)
        elif self.output.off & STOPPED:
            self.output.off &= ~STOPPED
            self.leds.off(GREEN)
        return True

    @cython.ccall
    def update(self, target: cython.longlong, current: cython.longlong) -> None:
        """One sample: drive the measured `current` towards `target` (A x 65536, the latter already limited)."""
        error: cython.longlong
        integral: cython.longlong
        total: cython.longlong
        counts: cython.longlong = 0
        largest: cython.longlong = self.output.largest
        if self.supervise(current):
            if self.output.off:
                self.errors.report(self.code_stopped)
            else:
                if (self.block_positive and target > 0) or (self.block_negative and target < 0):
                    target = 0
                error = target - current
                integral = self.integral + error
                if integral > self.integral_limit:
                    integral = self.integral_limit
                    self.errors.report(self.code_saturated)
                elif integral < -self.integral_limit:
                    integral = -self.integral_limit
                    self.errors.report(self.code_saturated)
                self.integral = integral
                total = (self.proportional_gain * error >> 16) + (self.integral_gain * integral >> 16)
                if total > 0x7FFFFFFF:
                    total = 0x7FFFFFFF
                    self.errors.report(self.code_sum)
                elif total < -0x80000000:
                    total = -0x80000000
                    self.errors.report(self.code_sum)
                counts = self.limits.limit_duty(total, current) >> 16
                if counts > largest:
                    counts = largest
                    self.errors.report(self.code_duty)
                elif counts < -largest:
                    counts = -largest
                    self.errors.report(self.code_duty)
            self.duty = counts
            self.output.write(counts)
