from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.foundation.events cimport PWM_UPDATE

cimport cython

cpdef enum:
    LER_MR0 = 0x1
    LER_MR1 = 0x2
    LER_MR2 = 0x4
    LER_MR3 = 0x8
    LER_MR4 = 0x10
    LER_MR5 = 0x20
    LER_MR6 = 0x40

@cython.final
cdef class Pwm(Peripheral):
    # what a new duty touches
    cdef public long long MR2, MR6, period_start, rest, rate, period_ns
    cdef public long long LER, driven, latched_MR0, latched_MR2, latched_MR6
    # the rest
    cdef public long long MR0, MR1, MR3, MR4, MR5, hz, phase_ns
    cdef public long long latched_MR1, latched_MR3, latched_MR4, latched_MR5
    cpdef int write(self, long long MR2, long long MR6) except -1
    cpdef int latch(self, long long mask) except -1
    cpdef int tell(self) except -1
    cdef int _count_periods(self) except -1
    cdef void _find_period(self) noexcept
    cdef long long _go_on(self, long long periods) noexcept
