from libc.math cimport M_PI as pi, sqrt, tan

cpdef enum:
    SETTLED = 2000

cdef long long _MASK, _NEWEST

cdef class ButterworthFilter:
    cdef public double b0, b1, b2, a1, a2
    cdef public long long violations, stamp
    cdef public bint started
    cdef public double x1, x2, y1, y2, output, held
    cpdef int rest_at(self, double value) except -1
    cpdef double push(self, double value) except? -1
    cpdef double push_stamped(self, double value, long long stamp_ms) except? -1
