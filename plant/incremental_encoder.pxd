cimport cython

from libc.math cimport cos, sin, sqrt
from foundation.random_stream cimport RandomStream
from foundation.edge_buffer cimport EdgeBuffer

@cython.final
cdef class IncrementalEncoder:
    cdef public str name
    cdef public object seed
    cdef public long long lines, sign, table_size, cell, total, t0, last_time
    cdef public double gear, shaft_per_rad, edges_per_shaft_rad, scale, offset_rad
    cdef public double eccentricity_1, phase_1, eccentricity_2, phase_2, jitter
    cdef public RandomStream stream
    cdef public double[::1] errors
    cdef public bint has_errors, started, broken, eccentric
    cdef public EdgeBuffer edges
    cdef public double u0, du, m0, m1, span_ns, edges_per_rad, edges_at_zero
    cdef public double calm_from, calm_to, calm_rad
    cpdef double position(self, double angle) noexcept
    cpdef double speed(self, double angle, double rate) noexcept
    cpdef double threshold(self, long long n) noexcept
    cpdef void reset(self, double angle) noexcept
    cpdef long long level_a(self) noexcept
    cpdef long long level_b(self, double angle)
    cpdef void update(self, long long t0, long long t1, double angle0, double rate0, double angle1, double rate1)
    cdef void _calm(self) noexcept
    cpdef double _value(self, double x) noexcept
    cpdef void _turning(self, long long t0, long long t1, double u0, double u1, double m0, double m1)
    cpdef void _piece(self, double x0, double x1)
    cpdef void _emit(self, double x0, double x1, double level, long long level_b)
