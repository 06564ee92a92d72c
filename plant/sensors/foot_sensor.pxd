cimport cython

from libc.math cimport exp

@cython.final
cdef class FootSensors:
    cdef public double closure, last_h, decay, share, per_N, left_gain, right_gain, swing_counts, span_counts
    cdef public double left_V, right_V, rise_time_constant_s
    cdef public str name
    cpdef void step(self, double h, bint contact, double load_N) noexcept
    cpdef void settle(self, bint contact, double load_N) noexcept
