from ranger_sim.firmware_sim.peripherals.adc_external cimport Ads7871
from ranger_sim.firmware_sim.peripherals.adc_internal cimport AdcInternal
from ranger_sim.foundation.numbers cimport fixed_multiply, fixed_of_float, float32, float_of_fixed

cimport cython

@cython.final
cdef class AdcReadings:
    cdef public Ads7871 external
    cdef public AdcInternal internal
    cdef public long long motor_entry, motor_offset, motor_gain_fixed, battery_entry, battery_offset
    cdef public long long battery_gain_fixed, voltage_gain_fixed
    cdef public double motor_gain, battery_gain, voltage_gain, power_gain
    cpdef long long motor_current_fixed(self) noexcept
    cpdef double motor_current(self) noexcept
    cpdef double battery_current(self) noexcept
    cpdef double battery_voltage(self) noexcept
    cpdef double battery_power(self) noexcept
    cpdef double battery_power_fixed(self) noexcept
