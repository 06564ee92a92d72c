from ranger_sim.foundation.events cimport FLAG_SINGLE_SHOT
from ranger_sim.boards.modules.can_load cimport CanLoad
from ranger_sim.boards.modules.network_time cimport NetworkTime
from ranger_sim.firmware_sim.peripherals.can_controller cimport EIGHT_BYTES, CanController

cimport cython

cpdef enum:
    TICKS_PER_MS = 5
    SYNC_BUFFER = 3
    SYNC_IDENTIFIER = 0

cdef long long _MASK

@cython.final
cdef class NetworkClock:
    cdef public NetworkTime time
    cdef public CanLoad load
    cdef public long long ticks, divider
    cdef public list controllers
    cdef public long long[5] sent, skipped
    cpdef bint tick(self) except? -1
    cpdef long long send_sync(self) except? <long long>-1
