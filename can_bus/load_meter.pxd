cimport cython

cpdef enum:
    WINDOWS_KEPT = 1024

@cython.final
cdef class LoadMeter:
    cdef public long long bits, window_busy, window_end, taken_until
    cdef public long long origin_bit, window_bits, busiest, count
    cdef public long long[::1] ring

    cdef void take(self, long long first, long long free) noexcept
    cdef void _split(self, long long first, long long last) noexcept
    cdef void _roll(self, long long bit) noexcept
