from ranger_sim.firmware_sim.alarm cimport Alarm
from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.vic cimport InterruptSource
from ranger_sim.foundation.events cimport UART_OUTPUT

cdef class HsUart(Peripheral):
    cdef public long long number, rate, hz, byte_ns
    cdef public Alarm done_alarm
    cdef public double baud
    cdef public InterruptSource source
    cdef public bint busy, waits_for_cts, clear_to_send, overrun
    cdef public object held
    cdef public long long sent, buffer_bytes, active, filled, received, lost
    cdef public long long[::1] buffers
    cpdef bint transmit(self, object data) except? -1
    cdef int _begin(self, object data, long long time) except -1
    cdef void _store(self, long long byte)
    cpdef long long swap(self) except? -1
    cpdef long long taken(self, long long place) except? -1
