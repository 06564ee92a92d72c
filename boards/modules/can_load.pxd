cimport cython

@cython.final
cdef class CanLoad:
    cdef public long long[5] counts, peaks, last_counts
    cpdef void count(self, long long channel) noexcept
    cpdef void end_of_millisecond(self) noexcept
    cpdef double report_peak(self, long long channel) noexcept
