from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.vic cimport InterruptSource
from ranger_sim.foundation.events cimport SSP_LOAD, SSP_START, EventQueue

cimport cython

cdef class SspDevice(Peripheral):
    cdef public long long bits
    cpdef int begin(self, long long time) except -1
    cpdef long long exchange(self, long long word, long long time) except? <long long>-1

@cython.final
cdef class SspMaster(Peripheral):
    cdef public SspDevice device
    cdef public long long bits
    cpdef long long word(self, long long word) except? <long long>-1

@cython.final
cdef class SspSegment:
    cdef public long long used
    cdef public long long checksum_error
    cdef public long long[18] rows
    cpdef void clear(self) noexcept
    cpdef void copy_from(self, SspSegment other) noexcept

@cython.final
cdef class SspPort(Peripheral):
    cdef public bint fresh
    cdef public long long number
    cdef public InterruptSource source
    cdef public SspSegment received, loaded
    cdef public long long received_time, exchanges, overwritten
    cpdef void start(self, SspSegment segment) noexcept
    cpdef void load(self, SspSegment segment) noexcept
    cpdef SspSegment take(self)

cpdef long long segment_time_ns(long long words, long long word_bits, long long bit_rate) except? <long long>-1
