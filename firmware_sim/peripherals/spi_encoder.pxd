cimport cython

from ranger_sim.firmware_sim.alarm cimport Alarm
from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.vic cimport InterruptSource

cpdef enum:
    SPSR_SPIF = 0x80

@cython.final
cdef class SpiEncoder(Peripheral):
    # what a transfer touches
    cdef public bint busy
    cdef public Alarm alarm
    cdef public long long word
    cdef public long long mask, latched, SPDR, SPSR, transfer_ns
    cdef public InterruptSource source
    # the rest
    cdef public long long number, bits, bit_rate, not_finished
    cpdef bint start(self) except? -1
    cpdef long long read(self) noexcept
