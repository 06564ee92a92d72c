cimport cython

@cython.final
cdef class AnalogPins:
    cdef public long long count
    cdef public long long[::1] start_times, end_times, places, feed_times
    cdef public double[::1] start_values, end_values, feed_starts, feed_ends
    cpdef int set_pair(self, long long index, long long t0, double v0, long long t1, double v1) except -1
    cpdef double volts(self, long long index, long long time) except? -1
