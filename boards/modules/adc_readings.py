# cython: boundscheck=False, wraparound=False
# (entries are places of the converter's sequence)
"""From converter counts to amperes, volts and watts, with the constants of one board
(robot.md N4 and N5).

Values that are published are products of single floats, rounded as the firmware's; inside the control loop the gain is
truncated to 16.16 (100 instead of 100.9 for the hip), as in the firmware.
"""

import cython

from ranger_sim.firmware_sim.peripherals.adc_external import Ads7871
from ranger_sim.firmware_sim.peripherals.adc_internal import AdcInternal
from ranger_sim.foundation.numbers import fixed_multiply, fixed_of_float, float32, float_of_fixed


@cython.final
@cython.cclass
class AdcReadings:
    """Motor current = -gain (raw - offset), battery current = gain (raw - offset), voltage = gain raw.

    `*_entry`: place of the quantity in the external converter's sequence. Currents in A, voltages in V.
    """

    external: Ads7871
    internal: AdcInternal
    motor_entry: cython.longlong
    motor_offset: cython.longlong
    motor_gain_fixed: cython.longlong
    battery_entry: cython.longlong
    battery_offset: cython.longlong
    battery_gain_fixed: cython.longlong
    voltage_gain_fixed: cython.longlong
    motor_gain: cython.double
    battery_gain: cython.double
    voltage_gain: cython.double
    power_gain: cython.double

    def __init__(
        self,
        external: Ads7871,
        internal: AdcInternal,
        motor_entry,
        motor_gain,
        motor_offset,
        battery_entry,
        battery_gain,
        battery_offset,
        voltage_gain,
    ) -> None:
        self.external = external
        self.internal = internal
        self.motor_entry = motor_entry
        self.motor_gain = float32(motor_gain)
        self.motor_offset = motor_offset
        self.motor_gain_fixed = fixed_of_float(motor_gain)
        self.battery_entry = battery_entry
        self.battery_gain = float32(battery_gain)
        self.battery_gain_fixed = fixed_of_float(battery_gain)
        self.battery_offset = battery_offset
        self.voltage_gain = float32(voltage_gain)
        self.voltage_gain_fixed = fixed_of_float(voltage_gain)
        self.power_gain = float32(self.voltage_gain * self.battery_gain)

    @cython.ccall
    @cython.exceptval(check=False)
    def motor_current_fixed(self) -> cython.longlong:
        """Motor current as the loop sees it, A x 65536."""
        return -(self.external.results[self.motor_entry] - self.motor_offset) * self.motor_gain_fixed

    @cython.ccall
    @cython.exceptval(check=False)
    def motor_current(self) -> cython.double:
        """Motor current, A."""
        return float32(-self.motor_gain * (self.external.results[self.motor_entry] - self.motor_offset))

    @cython.ccall
    @cython.exceptval(check=False)
    def battery_current(self) -> cython.double:
        """Current from the battery into the motor stage, A."""
        return float32(self.battery_gain * (self.external.results[self.battery_entry] - self.battery_offset))

    @cython.ccall
    @cython.exceptval(check=False)
    def battery_voltage(self) -> cython.double:
        """Battery voltage, V."""
        return float32(self.voltage_gain * self.internal.result)

    @cython.ccall
    @cython.exceptval(check=False)
    def battery_power(self) -> cython.double:
        """Power from the battery, W: the whole numbers are multiplied first, then once by the product of the gains."""
        counts: cython.longlong = self.internal.result * (
            self.external.results[self.battery_entry] - self.battery_offset
        )
        return float32(self.power_gain * float32(counts))

    @cython.ccall
    @cython.exceptval(check=False)
    def battery_power_fixed(self) -> cython.double:
        """The same by a 16.16 product, as the steering board does it, W.

        Both gains are truncated to 16.16 first: that of the current to 3/65536, a tenth less than it should be.
        """
        current: cython.longlong = self.external.results[self.battery_entry] - self.battery_offset
        return float_of_fixed(
            fixed_multiply(current * self.battery_gain_fixed, self.internal.result * self.voltage_gain_fixed)
        )
