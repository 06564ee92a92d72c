# Generated from boards/modules/adc_readings.py and boards/modules/adc_readings.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.firmware_sim.peripherals.adc_external import Ads7871
from ranger_sim.firmware_sim.peripherals.adc_internal import AdcInternal
from typing import Any
from typing import final

@final
class AdcReadings:
    external: Ads7871
    internal: AdcInternal
    motor_entry: int
    motor_offset: int
    motor_gain_fixed: int
    battery_entry: int
    battery_offset: int
    battery_gain_fixed: int
    voltage_gain_fixed: int
    motor_gain: float
    battery_gain: float
    voltage_gain: float
    power_gain: float
    def __init__(self, external: Ads7871, internal: AdcInternal, motor_entry: int, motor_gain: Any, motor_offset: int, battery_entry: int, battery_gain: Any, battery_offset: int, voltage_gain: Any) -> None: ...
    def motor_current_fixed(self) -> int: ...
    def motor_current(self) -> float: ...
    def battery_current(self) -> float: ...
    def battery_voltage(self) -> float: ...
    def battery_power(self) -> float: ...
    def battery_power_fixed(self) -> float: ...
