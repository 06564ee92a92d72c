cdef class Crystal:
    cdef public long long nominal_hz, ppb
    cpdef long long tick_time_ns(self, long long n, long long period_ns, long long phase_ns)
    cpdef long long local_ns(self, long long true_ns)
    cpdef long long true_ns(self, long long local_ns)
    cpdef long long cycles_to_ns(self, long long cycles, long long hz)
    cpdef long long ns_to_cycles(self, long long ns, long long hz)
    cpdef double ns_per_cycle(self, long long hz)
    cpdef double cycles_per_ns(self, long long hz)
