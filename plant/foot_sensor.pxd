cimport cython

from libc.math cimport exp

@cython.final
cdef class FootSensors:
    cdef public str name
    cdef public double rise_time_constant_s, share, per_N, left_gain, right_gain, swing_counts, span_counts
    cdef public double closure, last_h, decay, left_V, right_V
    cpdef void step(self, double h, bint contact, double load_N) noexcept
    cpdef void settle(self, bint contact, double load_N) noexcept
