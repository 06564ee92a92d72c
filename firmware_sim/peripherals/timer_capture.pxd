cimport cython

from firmware_sim.clock cimport TickTrain
from firmware_sim.microcontroller cimport Peripheral
from firmware_sim.vic cimport InterruptSource

@cython.final
cdef class TimerCapture(Peripheral):
    cdef public long long number, MR0, period_ns, phase_ns, hz
    cdef public double counts_per_ns
    cdef public long long CCR, IR
    cdef public TickTrain ticks
    cdef public long long wrap_time, next_wrap_time, alarm
    cdef public bint match_interrupt
    cdef public InterruptSource match_source
    cdef public list sources
    cdef public long long[::1] pins, captures, captured, lost
    cpdef long long CR(self, long long channel) except? <long long>-1
    cpdef long long TC(self) except? <long long>-1
    cpdef long long clear(self, long long mask) noexcept
    cpdef int arm(self, long long channel, bint rising, bint falling) except -1
    cpdef long long arm_one(self, long long channel, bint rising) noexcept
    cpdef long long count_at(self, long long time) except? <long long>-1
    cdef long long _wrap_to(self, long long time) except? <long long>-1
