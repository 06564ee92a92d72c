cimport cython
from libc.math cimport copysign

from ranger_sim.firmware_sim.alarm cimport Alarm
from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.vic cimport InterruptSource

cpdef enum:
    START = 0x80
    GAIN_SHIFT = 4
    GAIN_MASK = 7
    CHANNEL_MASK = 15
    COUNTS = 8192
    LEAST_COUNT = -8192
    LAST_COUNT = 8191
    RESTART_NS = 2500

@cython.final
cdef class Ads7871(Peripheral):
    # what a conversion touches
    cdef public bint busy, done
    cdef public long long step, length, register4
    cdef public Alarm alarm
    cdef public InterruptSource source
    cdef public long long conversion_ns, offset_counts
    cdef public long long[16] sequence, inputs
    cdef public double[8] gains
    cdef public double count_V
    cdef public long long result
    cdef public long long[16] results
    # the rest
    cdef public long long eint, not_finished
    cpdef bint start(self, long long register4) except? -1
    cpdef bint write(self, long long register4, long long time) except? -1
    @cython.final
    cdef void _take(self, long long register4, long long time) noexcept
    cpdef long long read_result(self) noexcept
    cpdef bint start_sequence(self) except? -1
    cpdef bint sequence_done(self) noexcept
    cpdef long long convert(self, double volts, long long gain_code) noexcept
