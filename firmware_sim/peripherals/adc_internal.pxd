cimport cython

from ranger_sim.firmware_sim.alarm cimport Alarm
from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.vic cimport InterruptSource

cpdef enum:
    CONVERSION_CLOCKS = 11
    COUNTS = 1024
    LAST_COUNT = 1023
    CR_CLKDIV_SHIFT = 8
    CR_BURST = 0x10000
    CR_PDN = 0x200000
    CR_START = 0x1000000
    GDR_RESULT_SHIFT = 6
    GDR_CHN_SHIFT = 24
    GDR_DONE_ABOVE_CHN = 0x80

@cython.final
cdef class AdcInternal(Peripheral):
    # what a conversion touches
    cdef public bint busy
    cdef public long long channel
    cdef public Alarm alarm
    cdef public InterruptSource source
    cdef public long long conversion_ns, single
    cdef public long long CR, GDR
    cdef public double scale, count_V
    cdef public long long result, offset_counts
    cdef public long long[8] inputs
    # burst mode, and the rest
    cdef public long long[8] channels
    cdef public long long burst_count, burst_start
    cdef public long long hz, clkdiv, not_finished
    cpdef long long convert(self, double volts) noexcept
    cpdef bint start(self, long long channel) except? -1
    cpdef long long DR(self, long long channel) except? <long long>-1
