cimport cython

from ranger_sim.firmware_sim.lpc2194.block cimport Block
from ranger_sim.firmware_sim.lpc2194.timer cimport ProgrammedTimer
from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.peripherals.gpio cimport Gpio

cpdef enum:
    TIMER_BIT = 2
    NO_CAPTURE = -1

@cython.final
cdef class PinSelectBlock(Block):
    cdef public long long[3] words
    cdef public ProgrammedTimer timer0, timer1
    cdef public long long[64] capture, interrupt
    cdef public Peripheral external
    cpdef object connect(self)

@cython.final
cdef class Ports(Gpio):
    cdef public long long[2] direction, latch, hidden
    cdef int drive(self, long long port, long long bits) except -1
    cdef int put(self, long long port, long long bits, long long levels) except -1
    cdef int direct(self, long long port, long long value) except -1

@cython.final
cdef class FastGpioBlock(Block):
    cdef public Ports ports
    cdef int _put(self, long long offset, long long value, long long chosen) except -1

@cython.final
cdef class OldGpioBlock(Block):
    cdef public Ports ports
