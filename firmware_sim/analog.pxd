cimport cython

@cython.final
cdef class AnalogPins:
    # where the three arrays of `feed` begin: pointers are a fraction of what three array fields take in the cache
    cdef long long* feed_times
    cdef double* feed_starts
    cdef double* feed_ends
    cdef public long long[32] places
    cdef public long long count
    cdef public long long[32] start_times, end_times
    cdef public double[32] start_values, end_values
    cdef public object feed
    cpdef int set_pair(self, long long index, long long t0, double v0, long long t1, double v1) except -1
    cpdef double volts(self, long long index, long long time) noexcept
