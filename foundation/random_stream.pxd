from libc.math cimport log, sqrt

cdef class RandomStream:
    cdef public str name
    cdef public unsigned long long state, increment, multiplier_1, multiplier_2
    cdef public double spare
    cdef public bint has_spare
    cpdef unsigned long long bits(self)
    cpdef double uniform(self)
    cpdef long long integer(self, long long n)
    cpdef double normal(self)
