from boards.modules.network_time cimport NetworkTime
from firmware_sim.microcontroller cimport Microcontroller

cimport cython

@cython.final
cdef class ExecutionTimer:
    cdef public Microcontroller chip
    cdef public NetworkTime time
    cdef public long longest, longest_ever
    cpdef double seconds(self) noexcept
    cpdef double longest_seconds(self) noexcept
