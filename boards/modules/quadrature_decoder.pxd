cimport cython

from boards.modules.error_module cimport ErrorModule
from foundation.numbers cimport divide_toward_zero

@cython.final
cdef class QuadratureDecoder:
    # what an edge and a slot touch
    cdef public long long count, write, read, edges
    cdef public long long position, position_gain, position_shift
    cdef public long long rate, rate_gain, rate_shift, filter_exponent
    cdef public long long sign, mean, idle, speed, filtered
    cdef public int[64] ring
    # the rest
    cdef public long long glitches, dropped_times
    cdef public ErrorModule errors
    cdef public long long glitch_code, full_code
    cdef public double rad_per_count
    cpdef int edge(self, bint rising, bint partner_high, long long elapsed) except -1
    cpdef int glitch(self) except -1
    cpdef int store(self, long long elapsed) except -1
    cpdef int set_position(self, long long position) except -1
