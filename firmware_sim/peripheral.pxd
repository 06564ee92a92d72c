cimport cython

from ranger_sim.firmware_sim.chip cimport Chip
from ranger_sim.firmware_sim.vic cimport InterruptSource
from ranger_sim.foundation.events cimport PIN_EDGE, EventQueue

cdef class Peripheral:
    cdef public Chip chip
    cpdef InterruptSource on_message(self, EventQueue queue)
    cpdef long long on_pin(self, long long channel, long long level, long long time) except? <long long>-1
    cpdef int on_level(self, long long pin, long long level) except -1
    cpdef int on_pwm(self, object pwm) except -1
    cpdef InterruptSource on_alarm(self, long long alarm, long long time)
    cpdef object transmit_ends(self)

@cython.final
cdef class Unclaimed(Peripheral):
    pass
