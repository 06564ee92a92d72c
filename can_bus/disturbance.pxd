from libc.math cimport log

from ranger_sim.foundation.events cimport NEVER
from ranger_sim.foundation.random_stream cimport RandomStream

cimport cython

@cython.final
cdef class Disturbance:
    cdef public long long next_bit
    cdef public long long frames_left, position
    cdef public list planned_bits
    cdef public RandomStream noise
    cdef public double bit_error_rate
    cdef public long long next_noise_bit

    cdef int _aim(self) except -1
    cdef int _draw_noise(self) except -1
    cdef long long strike(self, long long first, long long last, long long vulnerable) except? <long long>-2
