from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.foundation.numbers cimport fixed_multiply, fixed_of_float

cimport cython

cpdef enum:
    SLOT_S_FIXED = 32
    ONE = 65536

@cython.final
cdef class MotorLimits:
    # what every slot touches
    cdef public long long thermal, excess
    cdef public long long thermal_rate, thermal_limit, thermal_soft, thermal_multiplier, excess_multiplier
    cdef public long long current_min, current_max, target_min, target_max, speed_soft
    cdef public bint too_hot, overloaded, derating, peak
    # the rest
    cdef public ErrorModule errors
    cdef public long long thermal_slope, excess_limit, excess_fade, speed_max
    cdef public long long code_target, code_warm, code_hot, code_cooled, code_excess, code_excess_over
    cdef public long long code_speed, code_peak
    cpdef bint monitor(self, long long current) noexcept
    cpdef long long limit_target(self, long long target, long long velocity) noexcept
    cpdef long long limit_duty(self, long long duty, long long current) noexcept
