from firmware_sim.microcontroller cimport Peripheral

cimport cython

@cython.final
cdef class Pwm(Peripheral):
    cdef public long long MR0, MR1, MR2, MR3, MR4, MR5, MR6, LER, hz
    cdef public long long latched_MR0, latched_MR1, latched_MR2, latched_MR3, latched_MR4, latched_MR5, latched_MR6
    cdef public long long phase_ns, rate, period_ns, period_start, rest
    cpdef int write(self, long long MR2=*, long long MR6=*) except -1
    cpdef int latch(self, long long mask) except -1
    cdef int _count_periods(self) except -1
    cdef void _find_period(self) noexcept
