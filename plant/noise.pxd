cimport cython

from ranger_sim.foundation.random_stream cimport RandomStream

@cython.final
cdef class NoiseSource:
    cdef public long long left, word
    cdef public double[::1] table
    cdef public RandomStream stream
    cpdef double normal(self) noexcept
    cpdef long long block(self) noexcept
