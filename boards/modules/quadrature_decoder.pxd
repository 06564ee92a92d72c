cimport cython

from boards.modules.error_module cimport ErrorModule
from foundation.numbers cimport divide_toward_zero

@cython.final
cdef class QuadratureDecoder:
    cdef public ErrorModule errors
    cdef public long long glitch_code, full_code
    cdef public long long position_gain, position_shift, rate_gain, rate_shift, filter_exponent
    cdef public double rad_per_count
    cdef public long long count, position, rate
    cdef public long long[::1] ring
    cdef public long long write, read, edges, glitches, dropped_times
    cdef public long long sign, mean, idle, speed, filtered
    cpdef int edge(self, bint rising, bint partner_high, long long elapsed) except -1
    cpdef int glitch(self) except -1
    cpdef int store(self, long long elapsed) except -1
    cpdef int set_position(self, long long position) except -1
