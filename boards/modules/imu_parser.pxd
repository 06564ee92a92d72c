from firmware_sim.peripherals.uart cimport Uart
from foundation.numbers cimport float_of_word

cimport cython

@cython.final
cdef class ImuParser:
    cdef public object report
    cdef public long long header, needed, code_ring_full
    cdef public bint has_angles
    cdef public long long[::1] ring, words
    cdef public long long ring_write, ring_read
    cdef public double roll, pitch, yaw
    cdef public double rate_x, rate_y, rate_z
    cdef public double acceleration_x, acceleration_y, acceleration_z
    cdef public long long timer
    cdef public long long packets, bad_checksums, skipped_bytes, bytes_lost
    cpdef bint push(self, long long byte) except? -1
    cpdef long long receive(self, Uart uart) except? <long long>-1
    cpdef long long waiting(self) noexcept
    cpdef long long update(self) noexcept
