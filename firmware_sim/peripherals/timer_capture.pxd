cimport cython

from ranger_sim.firmware_sim.clock cimport TickTrain
from ranger_sim.firmware_sim.alarm cimport Alarm
from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.vic cimport InterruptSource

cpdef enum:
    IR_MR0 = 0x1
    IR_CR0 = 0x10
    CCR_RISING = 0x1
    CCR_FALLING = 0x2
    CCR_INTERRUPT = 0x4
    CCR_MASK = 0x7
    CCR_BITS = 3

cdef class TimerCapture(Peripheral):
    # what an edge touches
    cdef public long long IR, CCR
    cdef public long long wrap_time, next_wrap_time
    cdef public double counts_per_ns
    cdef public long long MR0
    cdef public long long[4] captures
    # what a wrap touches besides
    cdef public Alarm alarm
    cdef public InterruptSource match_source
    cdef public TickTrain ticks
    # the rest
    cdef public long long period_ns
    cdef public long long[4] lost
    cdef public long long[4] pins
    cdef public long long number, phase_ns, hz
    cdef public bint match_interrupt
    cpdef long long CR(self, long long channel) except? <long long>-1
    cpdef long long TC(self) except? <long long>-1
    cpdef long long clear(self, long long mask) noexcept
    cpdef int arm(self, long long channel, bint rising, bint falling) except -1
    cpdef long long count_at(self, long long time) except? <long long>-1
    cdef long long _wrap_to(self, long long time) except? <long long>-1
    cdef long long _skip_to(self, long long time) except? <long long>-1
    cdef long long _late_pin(self, long long channel, long long level, long long time) except? <long long>-1
