from ranger_sim.firmware_sim.peripherals.can_controller cimport EIGHT_BYTES
from ranger_sim.boards.modules.can_load cimport CanLoad
from ranger_sim.boards.modules.ssp_link cimport RouterSspLink
from ranger_sim.foundation.events cimport FLAG_REMOTE

cimport cython

cpdef enum:
    IDENTIFIERS = 2032
    CHANNEL_SSP = 0
    FIRST_BUS = 1
    LAST_BUS = 4
    CHANNEL_OWN = 5
    SOURCE_UNKNOWN = 7
    DESTINATIONS = 0xFF
    SOURCE_SHIFT = 8
    ALL_CHANNELS = 0x1F
    TO_SSP = 1
    NOT_LEARNED = 0x701
    RECEIVE_RING = 64
    RECEIVE_MASK = 63
    RECEIVED = 5
    TRANSMIT_RING = 8
    TRANSMIT_MASK = 7
    OWN_MASK = 7
    TO_SEND = 4

@cython.final
cdef class RoutingTable:
    cdef public long long[2032] rows
    cdef public long long learned, changed
    cpdef object set_destinations(self, identifier, mask)
    cpdef void learn(self, long long identifier, long long channel) noexcept
    cpdef void subscribe(self, long long identifier, long long channel) noexcept

@cython.final
cdef class Router:
    # what the main loop and a frame touch
    cdef public long long rx_write, rx_read, own_write, own_read, to_route, waiting
    cdef public RoutingTable table
    cdef public RouterSspLink ssp
    cdef public CanLoad load
    cdef public long long routed, copies
    cdef public bint one_frame_lag
    cdef public long long[5] tx_write, tx_read
    cdef public long long[320] rx_rows
    cdef public long long[32] own_rows
    cdef public long long[160] tx_rows
    # the rest
    cdef public object report
    cdef public long long receive_lost, own_lost, unroutable
    cdef public long long[5] transmit_lost, receive_lost_from
    cdef public long long[5] receive_full_codes
    cpdef bint receive(self, long long channel, long long identifier, long long flags, long long word0, long long word1) except? -1
    cpdef bint send(self, long long identifier, long long word0, long long word1) noexcept
    cpdef long long route_step(self, long long now) except? <long long>-1
    cpdef long long route(self, long long source, long long identifier, long long flags, long long word0, long long word1, long long now) except? <long long>-1
    cpdef bint queue(self, long long channel, long long identifier, long long flags, long long word0, long long word1) noexcept
    cdef bint _lose(self, long long channel) except? -1
    cdef long long _spread(self, long long mask, long long identifier, long long flags, long long word0, long long word1, long long now) except? <long long>-1
    cpdef long long frames_for(self, long long channel) noexcept
