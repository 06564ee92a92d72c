from libc.math cimport log, sqrt

cdef class RandomStream:
    cdef public str name
    cdef public unsigned long long state
    cdef public double spare
    cdef public bint has_spare
    cpdef unsigned long long bits(self)
    cpdef double uniform(self)
    cpdef long long integer(self, long long n)
    cpdef double normal(self)
