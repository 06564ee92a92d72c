from firmware_sim.microcontroller cimport Peripheral
from firmware_sim.vic cimport InterruptSource

cdef class TimerCapture(Peripheral):
    cdef public long long number, MR0, period_ns, phase_ns, hz
    cdef public double counts_per_ns
    cdef public long long CR0, CR1, CR2, CR3, CCR, IR
    cdef public long long wraps, wrap_time, next_wrap_time, alarm
    cdef public bint match_interrupt
    cdef public InterruptSource match_source
    cdef public list sources
    cdef public long long[::1] pins
    cdef public long long[::1] edges, captured, lost, capture_times
    cpdef long long TC(self)
    cpdef long long clear(self, long long mask)
    cpdef long long CR(self, long long channel)
    cpdef int arm(self, long long channel, bint rising, bint falling) except -1
    cpdef long long count_at(self, long long time)
    cdef long long _wrap_to(self, long long time)
