cdef class CanLoad:
    cdef public long long[::1] counts, peaks, totals, last_counts
    cpdef void count(self, long long channel)
    cpdef void end_of_millisecond(self)
    cpdef double report_peak(self, long long channel)
