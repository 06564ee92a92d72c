cimport cython

@cython.final
cdef class Drive:
    cdef public long long watchdog_ns, mr2, mr6, mr0, power_off_ns, switching_leads, power_losses
    cdef public long long capacity, count, next_change_ns
    cdef public bint enable2, enable6, powered, is_open, sensed_lead_switches
    cdef public double duty, ripple
    cdef public long long[::1] times, kinds, values
    cpdef void write_pwm(self, long long time, long long mr2, long long mr6, long long mr0) noexcept
    cpdef void watchdog_edge(self, long long time) noexcept
    cpdef void low_side(self, long long time, bint enable2, bint enable6) noexcept
    cpdef void _queue(self, long long time, long long kind, long long a, long long b, long long c) noexcept
    cpdef void apply(self, long long time) noexcept
    cpdef void _update(self) noexcept
