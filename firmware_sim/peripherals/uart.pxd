from firmware_sim.microcontroller cimport Peripheral
from firmware_sim.vic cimport InterruptSource

cdef class Uart(Peripheral):
    cdef public long long number, trigger, DL, DIVADDVAL, MULVAL, hz
    cdef public double baud
    cdef public long long byte_ns, timeout_alarm, transmit_alarm
    cdef public InterruptSource source, transmit_source
    cdef public long long[::1] fifo
    cdef public long long fifo_head, fifo_count, IIR, errors
    cdef public long long received, overruns, sent, refused, transmit_free
    cpdef void set_divisor(self, long long DL, long long DIVADDVAL=*, long long MULVAL=*)
    cpdef long long RBR(self)
    cpdef bint THR(self, long long byte)
    cpdef long long LSR(self)
    cpdef long long waiting(self)
    cdef void _store(self, long long byte)
