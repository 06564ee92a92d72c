cimport cython

from libc.math cimport exp, sin
from ranger_sim.foundation.random_stream cimport RandomStream
from ranger_sim.plant.sensors.noise cimport NoiseSource

cpdef enum:
    WORD_BITS = 13
    COUNTS_PER_TURN = 8192

@cython.final
cdef class AbsoluteEncoder:
    # what every word asks for stands first, beside each other
    cdef public NoiseSource noise
    cdef public double scale, offset_rad, lag_s, eccentricity_1, eccentricity_2, counts_per_rad, noise_counts, bit_flip
    cdef public long long zero
    cdef public double phase_1, phase_2, angle
    cdef public bint started
    cdef public RandomStream flips
    cdef public long long sign, flipped
    cdef public str name
    cpdef long long word(self, double angle, double h=*) noexcept
