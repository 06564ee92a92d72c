cimport cython

from firmware_sim.microcontroller cimport Peripheral
from firmware_sim.vic cimport InterruptSource

@cython.final
cdef class SpiEncoder(Peripheral):
    cdef public long long number, word, bits, bit_rate, transfer_ns, mask, alarm
    cdef public long long SPDR, SPSR, latched, transfers, not_finished
    cdef public bint busy
    cdef public InterruptSource source
    cpdef bint start(self) except? -1
    cpdef long long read(self) noexcept
