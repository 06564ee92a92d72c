# cython: boundscheck=False, wraparound=False
# (pins are those of the table below)
"""The H-bridge seen from the processor: two PWM leads, two low-side enables, the watchdog pin
(robot.md N4.4; appendix 3.8 on the alternating leads)."""

from typing import Final

import cython

from ranger_sim.boards.modules.receiver import IntReceiver
from ranger_sim.firmware_sim.peripherals.gpio import Gpio, p0, p1
from ranger_sim.firmware_sim.peripherals.pwm import Pwm
from ranger_sim.foundation.numbers import wrap_i32

PERIOD_COUNTS: Final = 600  # 100 kHz at 60 MHz
# Bits of `off`.
SLEEP: Final = 1
SHUTDOWN: Final = 2
STOPPED: Final = 4
OFF_UNLESS_0: Final = 0x7FFF  # the bits that SLEEP and SHUTDOWN use of their word

PINS = {
    "pwm_lead_2": p0(7),
    "pwm_lead_6": p0(9),
    "low_side_2": p0(11),
    "low_side_6": p1(17),
    "motor_watchdog": p0(6),
}


@cython.final
@cython.cclass
class OffRequest(IntReceiver):
    """SLEEP or SHUTDOWN as the main brain sent it last: `bit` of the output's `off` is set unless its low 15 bits are
    0."""

    output: "MotorOutput"
    bit: cython.longlong

    def __init__(self, output, bit) -> None:
        IntReceiver.__init__(self)
        self.output = output
        self.bit = bit

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        self.frames += 1
        self.value = wrap_i32(value_word)
        self.output.off &= ~self.bit
        if value_word & OFF_UNLESS_0 != 0:
            self.output.off |= self.bit


@cython.final
@cython.cclass
class MotorOutput:
    """Writes a duty (counts of 600, positive drives the motor forward) to alternating leads.

    `sign`: of the motor's mounting. `largest`: the duty is clipped to +/- this. `offset`: counts that the
    second of the two patterns drives more (14 in the firmware of 2016). `sleep`, `shutdown`: receivers of what the
    main brain asks for. `off`: why the motor may not be driven, 0 when it may. SLEEP: the bridge is open, the watchdog
    stays fed; SHUTDOWN: a duty of 0, and the watchdog starves; STOPPED, by the limits: the same.
    """

    second_pattern: cython.bint
    off: cython.longlong
    watchdog_pin: cython.longlong
    low_side_2_pin: cython.longlong
    low_side_6_pin: cython.longlong
    gpio: Gpio
    pwm: Pwm
    sign: cython.longlong
    largest: cython.longlong
    offset: cython.longlong
    low_side: cython.longlong
    duty: cython.longlong
    sleep: OffRequest
    shutdown: OffRequest

    def __init__(self, gpio: Gpio, pwm: Pwm, sign, largest, offset) -> None:
        self.gpio = gpio
        self.pwm = pwm
        self.off = 0
        self.sleep = OffRequest(self, SLEEP)
        self.shutdown = OffRequest(self, SHUTDOWN)
        self.sign = sign
        self.largest = largest
        self.offset = offset
        self.second_pattern = False
        self.duty = 0
        self.low_side = -1
        self.watchdog_pin = PINS["motor_watchdog"]
        self.low_side_2_pin = PINS["low_side_2"]
        self.low_side_6_pin = PINS["low_side_6"]

    @cython.ccall
    def feed_watchdog(self) -> None:
        """Toggle the watchdog pin, unless the motor is stopped or shut down."""
        if self.off & (SHUTDOWN | STOPPED) == 0:
            self.gpio.toggle(self.watchdog_pin)

    @cython.ccall
    def enable_low_side(self, on: cython.longlong) -> None:
        """Both low-side enables, written when they change."""
        if on != self.low_side:
            self.low_side = on
            self.gpio.write(self.low_side_2_pin, on)
            self.gpio.write(self.low_side_6_pin, on)

    @cython.ccall
    def write(self, duty: cython.longlong) -> None:
        """Drive the bridge with `duty` counts; the leads take turns at every call.

        Asleep, both leads rest at 0 and the pattern does not advance. Stopped or shut down, the patterns go on with a
        duty of 0, the second one with its offset, until the watchdog cuts the bridge off.
        """
        counts: cython.longlong
        MR2: cython.longlong = 0
        MR6: cython.longlong = 0
        low_side: cython.longlong = 1
        if self.off:
            duty = 0
        if self.off & SLEEP:
            low_side = 0
        else:
            if duty > self.largest:
                duty = self.largest
            elif duty < -self.largest:
                duty = -self.largest
            counts = duty * self.sign
            if self.second_pattern:
                self.second_pattern = False
                if counts >= 0:
                    MR2 = PERIOD_COUNTS
                    MR6 = PERIOD_COUNTS - counts - self.offset
                else:
                    MR2 = PERIOD_COUNTS + counts - self.offset
                    MR6 = PERIOD_COUNTS
            else:
                self.second_pattern = True
                if counts >= 0:
                    MR2 = counts
                else:
                    MR6 = -counts
        self.duty = duty
        if low_side != self.low_side:
            self.enable_low_side(low_side)
        if MR2 != self.pwm.MR2 or MR6 != self.pwm.MR6:
            self.pwm.write(MR2, MR6)
        self.feed_watchdog()
