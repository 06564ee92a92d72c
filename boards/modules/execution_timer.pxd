from ranger_sim.boards.modules.network_time cimport NetworkTime
from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.foundation.numbers cimport float32

cimport cython

cpdef enum:
    ANEW_MASK = 255

@cython.final
cdef class ExecutionTimer:
    cdef public Microcontroller chip
    cdef public NetworkTime time
    cdef public double seconds_per_cycle
    cdef public long long longest, longest_ever
    cpdef double seconds(self) noexcept
    cpdef double longest_seconds(self) noexcept
