from libc.math cimport M_PI as pi, sqrt, tan

cdef long long _MASK

cdef class ButterworthFilter:
    cdef public double b0, b1, b2, a1, a2
    cdef public long longest_gap, violations, stamp
    cdef public bint started
    cdef public double x1, x2, y1, y2, output
    cpdef int rest_at(self, double value) except -1
    cpdef double push(self, double value) except? -1
    cpdef double push_stamped(self, double value, long long stamp_ms) except? -1
