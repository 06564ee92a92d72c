cimport cython

from libc.math cimport exp, sin
from foundation.random_stream cimport RandomStream
from plant.noise cimport NoiseSource

@cython.final
cdef class AbsoluteEncoder:
    cdef public str name
    cdef public long long zero, sign, flipped
    cdef public double noise_counts, bit_flip, counts_per_rad, scale, offset_rad, lag_s, angle
    cdef public double eccentricity_1, phase_1, eccentricity_2, phase_2
    cdef public bint started
    cdef public NoiseSource noise
    cdef public RandomStream flips
    cpdef long long word(self, double angle, double h=*) noexcept
