from boards.modules.error_module cimport ErrorModule
from foundation.numbers cimport divide_toward_zero

cdef class QuadratureDecoder:
    cdef public ErrorModule errors
    cdef public long long glitch_code, full_code
    cdef public long long position_gain, position_shift, rate_gain, rate_shift, filter_exponent
    cdef public double rad_per_count
    cdef public long long count, position, rate
    cdef public long long[::1] ring
    cdef public long long write, read, edges, glitches, dropped_times
    cdef public long long sign, mean, idle, speed, filtered
    cpdef void edge(self, bint rising, bint partner_high, long long elapsed)
    cpdef void glitch(self)
    cpdef void store(self, long long elapsed)
    cpdef void update_angle(self)
    cpdef object update_rate(self)
    cpdef void set_position(self, long long position)
