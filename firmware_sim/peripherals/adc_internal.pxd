cimport cython

from firmware_sim.microcontroller cimport Peripheral
from firmware_sim.vic cimport InterruptSource

cdef long long _DONE

@cython.final
cdef class AdcInternal(Peripheral):
    cdef public long long clkdiv, hz, conversion_ns, alarm, CR, GDR, result, channel
    cdef public double reference_V, scale
    cdef public long long offset_counts
    cdef public InterruptSource source
    cdef public bint busy
    cdef public long long conversions, not_finished, started_time
    cdef public long long[::1] inputs, channels
    cdef public long long burst_count, burst_start
    cpdef long long convert(self, double volts) except? <long long>-1
    cpdef bint start(self, long long channel) except? -1
    cpdef long long DR(self, long long channel) except? <long long>-1
