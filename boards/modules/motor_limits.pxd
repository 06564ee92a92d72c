from boards.modules.error_module cimport ErrorModule
from foundation.numbers cimport fixed_multiply, fixed_of_float

cimport cython

@cython.final
cdef class MotorLimits:
    cdef public ErrorModule errors
    cdef public long long code_target, code_warm, code_hot, code_cooled, code_excess, code_excess_over
    cdef public long long code_speed, code_peak
    cdef public long long target_min, target_max, current_min, current_max
    cdef public long long thermal_limit, thermal_soft, thermal_rate, thermal_slope
    cdef public bint derating, peak, speed
    cdef public long long excess_limit, excess_fade, speed_max, speed_soft
    cdef public long long thermal, thermal_multiplier, excess, excess_multiplier
    cdef public bint too_hot, overloaded
    cpdef void monitor(self, long long current) noexcept
    cpdef long long limit_target(self, long long target, long long velocity) noexcept
    cpdef long long limit_duty(self, long long duty, long long current) noexcept
