from boards.modules.network_time cimport NetworkTime
from firmware_sim.microcontroller cimport Microcontroller

cdef class ExecutionTimer:
    cdef public Microcontroller chip
    cdef public NetworkTime time
    cdef public long long longest, longest_ever
    cpdef int record(self) except -1
    cpdef double seconds(self)
    cpdef double longest_seconds(self)
