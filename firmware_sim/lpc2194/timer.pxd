cimport cython

from ranger_sim.firmware_sim.lpc2194.block cimport Block, Clocks
from ranger_sim.firmware_sim.peripherals.timer_capture cimport CCR_BITS, CCR_INTERRUPT, IR_CR0, TimerCapture
from ranger_sim.firmware_sim.vic cimport InterruptSource
from ranger_sim.firmware_sim.clock cimport TickTrain
from ranger_sim.foundation.events cimport NEVER

cpdef enum:
    TCR_ENABLE = 1
    TCR_RESET = 2
    MCR_INTERRUPT = 1
    MCR_RESET = 2
    MCR_STOP = 4
    MCR_BITS = 3

@cython.final
cdef class ProgrammedTimer(TimerCapture):
    cdef public Clocks clocks
    cdef public long long TCR, PR, MCR, held, passed, planned, matches, match_time
    cdef public long long[4] match
    cpdef object stand(self, count)
    cpdef bint running(self) noexcept
    cpdef long long count(self) except? <long long>-1
    cdef long long _plan(self) except? <long long>-1
    cdef void _act(self)
    cdef void _new_period(self)
    cdef long long _count_before(self, long long at) noexcept
    cpdef object _stop_at(self, count)

@cython.final
cdef class TimerBlock(Block):
    cdef public ProgrammedTimer timer
