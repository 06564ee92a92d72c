cimport cython

from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.vic cimport InterruptSource
from ranger_sim.foundation.edge_buffer cimport EdgeBuffer
from ranger_sim.foundation.events cimport NEVER

@cython.final
cdef class EdgeLine:
    cdef public long long next_time, levels
    cdef public EdgeBuffer buffer
    cdef public long long pin, partner_pin, channel
    cdef public Peripheral peripheral
    cdef public InterruptSource source
    @cython.final
    cdef long long find_next(self) noexcept
