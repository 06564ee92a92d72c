cimport cython

from ranger_sim.foundation.random_stream cimport RandomStream

@cython.final
cdef class NoiseSource:
    cdef public long long drawn
    cdef public double[60] ahead
    cdef public long long left, word
    cdef public double[::1] table
    cdef public RandomStream stream
    cpdef double normal(self) noexcept
    @cython.final
    cdef void _draw_ahead(self) noexcept
    cpdef long long block(self) noexcept
