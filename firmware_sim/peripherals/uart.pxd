from firmware_sim.microcontroller cimport Peripheral
from firmware_sim.vic cimport InterruptSource

cimport cython

@cython.final
cdef class Uart(Peripheral):
    cdef public long long number, trigger, DL, DIVADDVAL, MULVAL, hz
    cdef public double baud
    cdef public long long byte_ns, timeout_alarm, transmit_alarm
    cdef public InterruptSource source, transmit_source
    cdef public long long[::1] fifo
    cdef public long long fifo_head, fifo_count, IIR, errors
    cdef public long long received, overruns, sent, refused, transmit_free
    cpdef int set_divisor(self, long long DL, long long DIVADDVAL=*, long long MULVAL=*) except -1
    cpdef long long RBR(self) noexcept
    cpdef bint THR(self, long long byte) except? -1
    cpdef long long LSR(self) except? <long long>-1
    cpdef long long waiting(self) noexcept
    cpdef long long read_all(self, long long[::1] ring, long long write, long long mask) noexcept
