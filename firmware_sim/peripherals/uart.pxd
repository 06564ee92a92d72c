from ranger_sim.firmware_sim.alarm cimport Alarm
from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.vic cimport InterruptSource
from ranger_sim.foundation.events cimport UART_OUTPUT

cimport cython

cpdef enum:
    FIFO_BYTES = 16
    BITS_PER_BYTE = 10
    CLOCKS_PER_BIT = 16
    TIMEOUT_BYTES = 4
    TIMEOUT_ALARM = 0
    TRANSMIT_ALARM = 1
    IIR_NONE = 1
    IIR_TRANSMIT = 2
    IIR_RECEIVED = 4
    IIR_TIMEOUT = 12
    LSR_RDR = 0x1
    LSR_OE = 0x2
    LSR_THRE = 0x20
    LSR_TEMT = 0x40

@cython.final
cdef class Uart(Peripheral):
    # what a received byte touches
    cdef public InterruptSource source
    cdef public long long byte_ns, trigger
    cdef public long long fifo_count, IIR, received
    cdef public long long[16] fifo
    # the rest
    cdef public long long overruns, errors
    cdef public long long number, DL, DIVADDVAL, MULVAL, hz
    cdef public double baud
    cdef public long long transmit_free, sent, refused
    cdef public Alarm timeout_alarm, transmit_alarm
    cdef public InterruptSource transmit_source
    cpdef int set_divisor(self, long long DL, long long DIVADDVAL=*, long long MULVAL=*) except -1
    cpdef long long RBR(self) noexcept
    cpdef bint THR(self, long long byte) except? -1
    cpdef long long LSR(self) except? <long long>-1
    cpdef long long waiting(self) noexcept
    cpdef void were_read(self, long long count) noexcept
