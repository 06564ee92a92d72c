cdef class Bridge:
    cpdef void write_pwm(self, long long time, long long mr2, long long mr6, long long mr0) noexcept
    cpdef void watchdog_edge(self, long long time) noexcept
    cpdef void low_side(self, long long time, bint enable2, bint enable6) noexcept
