cimport cython

from libc.math cimport cos, exp, sin
from ranger_sim.foundation.numbers cimport word_of_float
from ranger_sim.foundation.random_stream cimport RandomStream
from ranger_sim.foundation.edge_buffer cimport ByteBuffer

cdef long long _MASK, _TEN_BITS

cpdef enum:
    SILENT = 0
    HEADER_ANGLES_AND_RATES = 0xCF
    HEADER_RATES = 0xC2
    SET_MODE = 0xC4
    SET_MODE_SECOND = 0xC1
    SET_MODE_THIRD = 0x29
    PACKET_BYTES = 31
    MAX_FILTER = 64

@cython.final
cdef class Imu:
    # what every step and every packet look at stands first, beside each other
    cdef public ByteBuffer bytes
    cdef public long long next_sample_ns, acknowledge, line_free_ns, byte_ns, checksum, mode, samples, packets
    cdef public double rate_scale, lag_s, cross_x_from_z, bias_rad_s, noise_rad_s, roll_bias_rad, roll_noise_rad
    cdef public RandomStream stream
    cdef public long long filter_samples, latency_ns, baud, sample_ns, fusion_divider, ppb, phase_ns
    cdef public double lagged, rate_x, roll
    cdef public long long command, acknowledge_ns
    cdef public double ring_sum
    cdef public double[64] ring  # MAX_FILTER
    cpdef void receive_byte(self, long long time, long long byte) noexcept
    cpdef long long sample_time(self, long long n)
    cpdef bint is_due(self, long long t1) noexcept
    cpdef int update(
        self, long long t0, long long t1, double lean0, double rate0, double lean1, double rate1,
        double yaw=*, double yaw_rate=*,
    ) except -1
    cpdef void _begin(self) noexcept
    cpdef void _send(self, long long byte) noexcept
    cpdef void _word(self, long long word) noexcept
    cpdef void _sum(self) noexcept
    cpdef void _packet(self, long long start, double first, double second, double third, double yaw_rate) noexcept
    cpdef void _acknowledge(self) noexcept
