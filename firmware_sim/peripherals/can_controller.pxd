from ranger_sim.can_bus.node cimport WARNING_LIMIT
from ranger_sim.can_bus.transmit_ends cimport TransmitEnds
from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.vic cimport InterruptSource
from ranger_sim.foundation.events cimport CAN_ABORT, CAN_MODE, CAN_RX, CAN_STATUS, CAN_TX_DONE, FLAG_EXTENDED, FLAG_REMOTE, FLAG_SINGLE_SHOT, NEVER, TX_ABORTED, TX_SENT

cimport cython

cpdef enum:
    MOD_RESET = 0x1
    CMR_TR = 0x1
    CMR_AT = 0x2
    CMR_RRB = 0x4
    CMR_CDO = 0x8
    CMR_SRR = 0x10
    CMR_STB1 = 0x20
    CMR_STB2 = 0x40
    CMR_STB3 = 0x80
    ICR_RI = 0x1
    ICR_TI1 = 0x2
    ICR_DOI = 0x8
    ICR_ALI = 0x40
    ICR_TI2 = 0x200
    ICR_TI3 = 0x400
    ENDED_1 = 0x2
    ENDED_2_3 = 0xC
    TI2_SHIFT = 7
    SR_RBS = 0x1
    SR_DOS = 0x2
    SR_TBS = 0x4
    SR_TCS = 0x8
    SR_ES = 0x40
    SR_BS = 0x80
    SR_BUFFER_BITS = 8
    GSR_RX_ERRORS_SHIFT = 16
    GSR_TX_ERRORS_SHIFT = 24
    ERROR_COUNTER_MASK = 0xFF
    DLC_MASK = 0xF
    DLC_SHIFT = 16
    RTR_SHIFT = 26
    FF_SHIFT = 25
    EIGHT_BYTES = 8
    RFS_EIGHT_BYTES = 0x80000

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
