cimport cython

from foundation.random_stream cimport RandomStream

@cython.final
cdef class NoiseSource:
    cdef public RandomStream stream
    cdef public double[::1] table
    cdef public long long word, left
    cpdef double normal(self) noexcept
    cpdef long long block(self) noexcept
