cimport cython

from libc.math cimport cos, sin, sqrt
from ranger_sim.foundation.random_stream cimport RandomStream
from ranger_sim.foundation.edge_buffer cimport EdgeBuffer

cpdef enum:
    BOUNCE_NS = 3000

@cython.final
cdef class IncrementalEncoder:
    # what every step looks at stands first, beside each other
    cdef public EdgeBuffer edges
    cdef public double calm_rad, calm_from, calm_to, edges_per_rad, edges_at_zero
    cdef public bint started, eccentric, uneven, has_errors
    cdef public long long cell, total
    # the running piece
    cdef public double u0, du, m0, m1, span_ns
    cdef public long long t0, last_time
    # what describes the encoder
    cdef public long long bounces
    cdef public double jitter, bounce, scale, offset_rad, shaft_per_rad, edges_per_shaft_rad, gear
    cdef public double eccentricity_1, phase_1, eccentricity_2, phase_2
    cdef public long long lines, sign, table_size
    cdef public RandomStream stream
    cdef public double[::1] errors
    cdef public str name
    cdef public object seed
    cpdef double position(self, double angle) noexcept
    cpdef double speed(self, double angle, double rate) noexcept
    cpdef double threshold(self, long long n) noexcept
    cpdef void reset(self, double angle) noexcept
    cpdef long long level_a(self) noexcept
    cpdef long long level_b(self, double angle)
    cpdef long long update(
        self, long long t0, long long t1, double angle0, double rate0, double angle1, double rate1
    ) except? <long long>-1
    cpdef long long add_bounces(self, long long t1) except? <long long>-1
    cdef void _calm(self) noexcept
    cdef long long _one_way(self, long long t0, long long t1, double u0, double u1, double g0, double g1) except? <long long>-1
    cpdef double _value(self, double x) noexcept
    cpdef int _turning(self, long long t0, long long t1, double u0, double u1, double m0, double m1) except -1
    cpdef int _piece(self, double x0, double x1) except -1
    cpdef int _emit(self, double x0, double x1, double level, long long level_b) except -1
