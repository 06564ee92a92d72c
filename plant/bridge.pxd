cdef class Bridge:
    cpdef object write_pwm(self, long long time, long long mr2, long long mr6, long long mr0)
    cpdef object watchdog_edge(self, long long time)
    cpdef object low_side(self, long long time, bint enable2, bint enable6)
