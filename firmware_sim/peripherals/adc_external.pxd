cimport cython

from firmware_sim.microcontroller cimport Peripheral
from firmware_sim.vic cimport InterruptSource

@cython.final
cdef class Ads7871(Peripheral):
    cdef public long long eint, conversion_ns, alarm
    cdef public double reference_V, scale
    cdef public long long offset_counts
    cdef public InterruptSource source
    cdef public long long[::1] registers, gains, inputs
    cdef public bint busy
    cdef public long long result, conversions, started_time
    cdef public long long length, step
    cdef public long long[::1] sequence, sequence_inputs, results
    cdef public bint done
    cdef public long long not_finished
    cpdef bint start(self, long long register4) except? -1
    cpdef long long read_result(self) noexcept
    cpdef bint start_sequence(self) except? -1
    cpdef bint sequence_done(self) noexcept
    cpdef long long convert(self, double volts, long long gain_code) except? <long long>-1
