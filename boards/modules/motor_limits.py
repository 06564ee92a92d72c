"""The protection of a motor and its gearhead: clips, thermal model, peak current, speed, coupled
(appendix 4.7; robot.md N4.2, N4.3). All quantities are 16.16 fixed point.

The allowed range of the target current is the motor's clip, narrowed by the thermal state, narrowed again in
the direction of motion near the speed limit. The measured current acts on the duty: beyond the peak it is cut
in the same slot, and the integral of the excess fades the duty and switches the motor off.
"""

import math
from typing import Final

import cython

from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.foundation.numbers import fixed_multiply, fixed_of_float

SLOT_S_FIXED: Final = 32  # 0.5 ms x 65536, truncated (0.488 ms), as in the firmware
ONE: Final = 65536  # in 16.16

RATED_SPEED_RAD_S = 659.734  # 6300 rpm at the motor shaft (appendix 4.7)
SOFT_SPEED = 0.9  # the current fades from here to the rated speed (chosen by us: one tenth of the range)
SOFT_THERMAL = 0.75  # of the thermal limit (robot.md N4.3)


@cython.final
@cython.cclass
class MotorLimits:
    """Limits of one motor. Currents in A, `thermal_time` s, `gear` motor turns per joint turn (0: no speed).

    Switches: `derating` lets the thermal state narrow the target (otherwise the firmware's slope of the wrong
    sign acts on the duty, which never limits); `peak` cuts the duty of a slot whose current is beyond
    current_min ... current_max; `speed` is the speed limiter.
    """

    # what every slot touches
    thermal: cython.longlong
    excess: cython.longlong
    thermal_rate: cython.longlong
    thermal_limit: cython.longlong
    thermal_soft: cython.longlong
    thermal_multiplier: cython.longlong
    excess_multiplier: cython.longlong
    current_min: cython.longlong
    current_max: cython.longlong
    target_min: cython.longlong
    target_max: cython.longlong
    speed_soft: cython.longlong
    too_hot: cython.bint
    overloaded: cython.bint
    derating: cython.bint
    peak: cython.bint
    # the rest
    errors: ErrorModule
    thermal_slope: cython.longlong
    excess_limit: cython.longlong
    excess_fade: cython.longlong
    speed_max: cython.longlong
    code_target: cython.longlong
    code_warm: cython.longlong
    code_hot: cython.longlong
    code_cooled: cython.longlong
    code_excess: cython.longlong
    code_excess_over: cython.longlong
    code_speed: cython.longlong
    code_peak: cython.longlong

    def __init__(
        self,
        errors: ErrorModule,
        codes,
        target_min,
        target_max,
        current_min,
        current_max,
        thermal_current,
        thermal_time,
        excess_limit,
        gear,
        derating=True,
        peak=True,
        speed=True,
    ) -> None:
        self.errors = errors
        self.code_target = codes.MC_TCURR_OOB
        self.code_warm = codes.MC_TEMP_SAFE
        self.code_hot = codes.MC_TEMP_OFF
        self.code_cooled = codes.MC_TEMP_ON
        self.code_excess = codes.MC_MECH_OFF
        self.code_excess_over = codes.MC_MECH_ON
        self.code_speed = codes.MC_SPEED_LIMIT
        self.code_peak = codes.MC_CURR_OOB
        self.target_min = fixed_of_float(target_min)
        self.target_max = fixed_of_float(target_max)
        self.current_min = fixed_of_float(current_min)
        self.current_max = fixed_of_float(current_max)
        limit = thermal_current * thermal_current * thermal_time
        self.thermal_limit = fixed_of_float(limit)
        self.thermal_soft = fixed_of_float(SOFT_THERMAL * limit)
        self.thermal_rate = int(65536.0 / thermal_time)
        self.derating = derating
        if derating:
            self.thermal_slope = fixed_of_float(1.0 / (limit - SOFT_THERMAL * limit))
        else:
            # a current minus a thermal state: the firmware's mistake of units, hence the wrong sign
            self.thermal_slope = fixed_of_float(1.0 / (thermal_current - SOFT_THERMAL * limit))
        self.excess_limit = excess_limit * ONE
        self.excess_fade = max(1, excess_limit // 10)  # the duty has faded to 0 at a tenth of the limit
        self.peak = peak
        # nothing turns so fast where speed is not limited
        self.speed_max = fixed_of_float(RATED_SPEED_RAD_S / gear if speed and gear else math.inf)
        self.speed_soft = fixed_of_float(SOFT_SPEED * RATED_SPEED_RAD_S / gear if speed and gear else math.inf)
        self.thermal = 0  # A^2 s
        self.thermal_multiplier = ONE
        self.too_hot = False
        self.excess = 0  # A samples
        self.excess_multiplier = ONE
        self.overloaded = False

    @cython.ccall
    @cython.exceptval(check=False)
    def monitor(self, current: cython.longlong) -> cython.bint:
        """Every slot, also while the motor is off: advance both monitors with the measured current. True when the motor
        must be off."""
        thermal: cython.longlong = self.thermal
        excess: cython.longlong = self.excess
        loss: cython.longlong = fixed_multiply(current, current) - fixed_multiply(thermal, self.thermal_rate)
        thermal += (loss * SLOT_S_FIXED) >> 16
        self.thermal = thermal
        if thermal < self.thermal_soft:  # nearly always
            self.thermal_multiplier = ONE
            if self.too_hot:
                self.too_hot = False
                self.errors.report(self.code_cooled)
        elif thermal < self.thermal_limit:
            self.thermal_multiplier = ONE - fixed_multiply(thermal - self.thermal_soft, self.thermal_slope)
            self.errors.report(self.code_warm)
        else:
            self.thermal_multiplier = 0
            self.too_hot = True
            self.errors.report(self.code_hot)  # in every slot
        if current > 0:
            excess += current - self.current_max
        elif current < 0:
            excess += self.current_min - current
        if excess <= 0:  # nearly always
            self.excess = 0
            self.excess_multiplier = ONE
            if self.overloaded:
                self.overloaded = False
                self.errors.report(self.code_excess_over)
            return self.too_hot
        self.excess = excess
        self.excess_multiplier = max(0, ONE - excess // self.excess_fade)
        if excess >= self.excess_limit:
            self.overloaded = True
            self.errors.report(self.code_excess)  # in every slot
        return self.too_hot or self.overloaded

    @cython.ccall
    @cython.exceptval(check=False)
    def limit_target(self, target: cython.longlong, velocity: cython.longlong) -> cython.longlong:
        """The target current the motor may have now, at `velocity` (rad/s x 65536, joint side).

        MC_TCURR_OOB is part of every step: flip-up asks for 1.5 A/rad x (0.2 - 1.85) rad = -2.5 A where an
        ankle is clipped at -1 A (robot.md N4.2, C1.8), for the 0.1 s that the foot
        takes to come up. At one note per slot that is 190 per stride and board, on the robot too.
        """
        low: cython.longlong = self.target_min
        high: cython.longlong = self.target_max
        speed: cython.longlong = velocity if velocity >= 0 else -velocity
        share: cython.longlong
        if target > high:
            target = high
            self.errors.report(self.code_target)
        elif target < low:
            target = low
            self.errors.report(self.code_target)
        if self.derating and self.thermal_multiplier < ONE:
            high = fixed_multiply(high, self.thermal_multiplier)
            low = fixed_multiply(low, self.thermal_multiplier)
        if speed > self.speed_soft:
            share = 0
            if speed < self.speed_max:
                share = ((self.speed_max - speed) << 16) // (self.speed_max - self.speed_soft)
            if velocity > 0:
                high = fixed_multiply(high, share)
            else:
                low = fixed_multiply(low, share)
            if target > high or target < low:
                self.errors.report(self.code_speed)
        if target > high:
            return high
        if target < low:
            return low
        return target

    @cython.ccall
    @cython.exceptval(check=False)
    def limit_duty(self, duty: cython.longlong, current: cython.longlong) -> cython.longlong:
        """The controller's sum (counts x 65536), reduced as the measured current requires.

        A current beyond its peak would, at the same duty, be there in the next slot too (it settles within
        one), so the duty shrinks in proportion.
        """
        multiplier: cython.longlong = self.excess_multiplier
        if not self.derating and self.thermal_multiplier < multiplier:
            multiplier = self.thermal_multiplier
        if multiplier != ONE:
            duty = (duty * multiplier) >> 16
        if self.peak:
            if current > self.current_max and duty > 0:
                duty = duty * self.current_max // current
                self.errors.report(self.code_peak)
            elif current < self.current_min and duty < 0:
                duty = -(-duty * self.current_min // current)
                self.errors.report(self.code_peak)
        return duty
