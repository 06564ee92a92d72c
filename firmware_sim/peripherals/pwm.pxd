from firmware_sim.microcontroller cimport Peripheral

cdef class Pwm(Peripheral):
    cdef public long long MR0, MR1, MR2, MR3, MR4, MR5, MR6, LER, hz
    cdef public long long latched_MR0, latched_MR1, latched_MR2, latched_MR3, latched_MR4, latched_MR5, latched_MR6
    cdef public long long phase_ns, latch_time, updates
    cpdef void write(self, long long MR2=*, long long MR6=*)
    cpdef int latch(self, long long mask) except -1
    cpdef long long next_period(self)
