from ranger_sim.can_bus.transmit_ends cimport TransmitEnds
from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.vic cimport InterruptSource
from ranger_sim.foundation.events cimport CAN_RX, CAN_STATUS, CAN_TX_DONE, NEVER

cimport cython

@cython.final
cdef class CanController(Peripheral):
    # what a frame touches; registers of the chip have 32 bits
    cdef public InterruptSource rx_source, tx_source
    cdef public long long MOD
    cdef public TransmitEnds ends
    cdef readonly long long IER
    cdef public long long end_interrupts, ended, noted
    cdef public long long number, rx_count
    cdef public long long[4] tx_status
    cdef public long long RFS, RID, RDA, RDB
    cdef public long long second_RFS, second_RID, second_RDA, second_RDB
    cdef public long long received, sent, requests
    cdef public long long[4] TFI, TID, TDA, TDB
    # the rest
    cdef public long long data_overruns, lost, aborted, refused
    cdef public bint overrun, bus_off, error_warning
    cdef public long long tx_errors, rx_errors, BTR
    cdef public InterruptSource error_source
    cpdef bint transmit(self, long long buffer, long long identifier, long long flags, long long lo, long long hi) except? -1
    cpdef bint transmit_if_free(self, long long buffer, long long identifier, long long flags, long long lo, long long hi) except? -1
    cpdef bint free_at(self, long long buffer, long long time) noexcept
    cpdef bint buffer_free(self, long long buffer) noexcept
    cpdef int tell_end(self, long long buffer) except -1
    cpdef int tell_first_end(self) except -1
    cpdef int write_IER(self, long long value) except -1
    cpdef long long write_CMR(self, long long command) except? <long long>-1
    cpdef void write_MOD(self, long long mode) noexcept
    cpdef void release(self) noexcept
    cpdef long long read_ICR(self) noexcept
    cpdef long long SR(self) noexcept
    cpdef long long GSR(self) noexcept
    cpdef double bit_rate(self) except? -1
    cdef void _end(self, long long buffer, long long status) noexcept
    cdef void _look(self) noexcept
    cdef void _bus_off(self) noexcept

cdef long long frame_word(long long flags) noexcept
cdef long long buffers_of(long long word) noexcept
