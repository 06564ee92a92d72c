from firmware_sim.microcontroller cimport Peripheral
from firmware_sim.vic cimport InterruptSource

cdef class CanController(Peripheral):
    cdef public long long number, MOD, IER, ICR, BTR
    cdef public long long RFS, RID, RDA, RDB, rx_count
    cdef public long long second_RFS, second_RID, second_RDA, second_RDB
    cdef public long long[::1] TFI, TID, TDA, TDB, tx_free, tx_complete
    cdef public bint overrun, bus_off, error_warning
    cdef public long long tx_errors, rx_errors
    cdef public long long received, data_overruns, requests, sent, lost, aborted, refused
    cdef public InterruptSource rx_source, tx_source, error_source
    cpdef bint transmit(self, long long buffer, long long identifier, long long flags, long long lo, long long hi)
    cpdef bint buffer_free(self, long long buffer)
    cpdef void write_CMR(self, long long command)
    cpdef void write_MOD(self, long long mode)
    cpdef void release(self)
    cpdef long long read_ICR(self)
    cpdef long long SR(self)
    cpdef long long GSR(self)
    cpdef double bit_rate(self)
    cdef void _bus_off(self)
