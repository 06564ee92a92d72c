cdef class RcReceiver:
    cdef public object report
    cdef public long long[::1] levels, rising, seen, measured, pulses
    cdef public double[::1] filtered
    cdef public long long code_levels, code_channel, bad_levels
    cpdef long long capture(self, long long channel, long long level, long long ticks) except? -1
    cpdef double width(self, long long channel) except? -1
