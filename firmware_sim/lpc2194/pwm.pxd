cimport cython

from ranger_sim.firmware_sim.lpc2194.block cimport Block
from ranger_sim.firmware_sim.peripherals.pwm cimport Pwm

cpdef enum:
    TCR_COUNTS = 1
    TCR_PWM = 8
    MCR_RESET_MR0 = 2

@cython.final
cdef class PwmBlock(Block):
    cdef public Pwm pwm
    cdef public long long TCR, MCR, PCR
    cdef public bint begun
    cpdef object _look(self)
    cpdef object _drive(self)
    cdef long long _match(self, long long number) noexcept
