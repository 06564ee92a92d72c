cimport cython

from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.foundation.numbers cimport divide_toward_zero, float_of_fixed

cpdef enum:
    RING_MASK = 63
    SLOT_CYCLES = 30000
    LARGEST = 0x7FFFFFFF

@cython.final
cdef class QuadratureDecoder:
    # what an edge and a slot touch
    cdef public long long count, position
    cdef public long long position_gain
    cdef public long long position_shift, filter_exponent, write, read, rate_bits, sign
    cdef public long long rate_gain, mean
    cdef public long long idle, speed, filtered, rate
    cdef public bint after_glitch
    cdef public long long[64] ring
    # the rest
    cdef public long long glitches, dropped_times
    cdef public ErrorModule errors
    cdef public long long glitch_code, full_code, rate_shift
    cdef public double rad_per_count
    cpdef int edge(self, long long step, long long elapsed) except -1
    cpdef int glitch(self) except -1
    cdef void _be_silent(self) noexcept
    cdef void _note_glitch(self) noexcept
    cdef void _filter(self, long long times, long long total) noexcept
    cpdef double position_rad(self) noexcept
    cpdef double rate_rad_s(self) noexcept
    cpdef int set_position(self, long long position) except -1
    cpdef long long count_at(self, long long position) noexcept
