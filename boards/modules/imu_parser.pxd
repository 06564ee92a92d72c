from ranger_sim.firmware_sim.peripherals.uart cimport Uart
from ranger_sim.foundation.numbers cimport float_of_word

cimport cython

cpdef enum:
    HEADER_ANGLES_AND_RATES = 0xCF
    HEADER_RATES_ONLY = 0xC2
    PACKET_BYTES = 31
    PACKET_WORDS = 7
    RING_BYTES = 128
    RING_MASK = 127
    CHECKSUM_MASK = 0xFFFF

@cython.final
cdef class ImuParser:
    cdef public long long ring_write, ring_read, header, needed
    cdef public long long[128] ring
    cdef public long long[7] words
    cdef public bint has_angles
    cdef public double rate_x, rate_y, rate_z
    cdef public double roll, pitch, yaw
    cdef public double acceleration_x, acceleration_y, acceleration_z
    cdef public long long timer, packets
    cdef public long long bad_checksums, skipped_bytes, bytes_lost, code_ring_full
    cdef public object report
    cpdef bint push(self, long long byte) except? -1
    cpdef long long receive(self, Uart uart) except? <long long>-1
    cpdef long long waiting(self) noexcept
    cpdef long long update(self) noexcept
