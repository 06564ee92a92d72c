from firmware_sim.microcontroller cimport Peripheral
from foundation.events cimport EventQueue
from firmware_sim.vic cimport InterruptSource

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
    cpdef bint start(self, long long register4)
    cpdef long long read_result(self)
    cpdef bint start_sequence(self)
    cpdef object on_busy(self, EventQueue queue)
    cpdef bint sequence_done(self)
    cpdef long long convert(self, double volts, long long gain_code)
