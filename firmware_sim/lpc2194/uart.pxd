cimport cython

from ranger_sim.firmware_sim.lpc2194.block cimport Block
from ranger_sim.firmware_sim.peripherals.uart cimport IIR_NONE, IIR_RECEIVED, IIR_TIMEOUT, IIR_TRANSMIT, Uart

cpdef enum:
    IER_RECEIVE = 1
    IER_TRANSMIT = 2
    IER_STATUS = 4
    IIR_STATUS = 6
    LCR_DLAB = 0x80
    TER_ON = 0x80

@cython.final
cdef class UartBlock(Block):
    cdef public Uart uart
    cdef public long long IER, LCR, MCR, SCR, FCR, FDR, TER, divisor
    cdef public bint holds
    cpdef object _set_rate(self)
    cdef void look(self) noexcept
    cdef long long identity(self) noexcept
    cpdef object _enable(self, value)
