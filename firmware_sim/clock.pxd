cimport cython

@cython.final
cdef class Crystal:
    cdef public long long nominal_hz, ppb
    cpdef long long tick_time_ns(self, long long n, long long period_ns, long long phase_ns) except? <long long>-1
    cpdef long long local_ns(self, long long true_ns) except? <long long>-1
    cpdef long long true_ns(self, long long local_ns) except? <long long>-1
    cpdef long long cycles_to_ns(self, long long cycles, long long hz) except? <long long>-1
    cpdef long long ns_to_cycles(self, long long ns, long long hz) except? <long long>-1
    cpdef double ns_per_cycle(self, long long hz)
    cpdef double cycles_per_ns(self, long long hz)

@cython.final
cdef class TickTrain:
    cdef public long long rate, period_ns, phase_ns, step_ns, step_rest, number, time, rest
    cpdef long long next(self) noexcept
