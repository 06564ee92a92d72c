from libc.math cimport log

from ranger_sim.can_bus.frame cimport ARBITRATION_END, EXTENDED_ARBITRATION_END
from ranger_sim.foundation.events cimport FLAG_EXTENDED, NEVER
from ranger_sim.foundation.random_stream cimport RandomStream

cimport cython

@cython.final
cdef class Disturbance:
    cdef public long long next_bit
    cdef public long long frames_left, position
    cdef public list planned_bits
    cdef public RandomStream noise
    cdef public double bit_error_rate
    cdef public long long next_noise_bit, next_misread
    cdef public list misread

    cdef int _aim(self) except -1
    cdef int _draw_noise(self) except -1
    cdef int meet_frame(self, long long start, long long bits, long long flags) except -1
    cdef int strike(self, long long bit) except -1
    cdef long long misreading(self, long long bit) except? <long long>-1
