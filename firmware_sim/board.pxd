from ranger_sim.firmware_sim.analog cimport AnalogPins
from ranger_sim.foundation.edge_buffer cimport EdgeBuffer
from ranger_sim.foundation.events cimport NEVER, EventQueue, Outbox

cdef class Board:
    cdef public long long next_time, edge_time, horizon
    cdef public EventQueue inbox
    cdef public Outbox outbox
    cdef public AnalogPins analog
    cdef public long long[::1] words
    cdef public str name
    cdef public bint apart
    cdef public object memory
    cpdef void begin(self, long long until)
    cpdef long long advance(self, long long until) except? -1
    cpdef long long stop_at(self, long long time) noexcept
    cpdef long long speaks_from(self) except? <long long>-1
    cpdef long long quiet_until(self) noexcept
    cpdef long long urgent_kinds(self) noexcept
    cpdef int listen_to_edges(self, EdgeBuffer buffer, long long pin, long long partner_pin) except -1
    cpdef long long edges_came(self) noexcept
    cpdef object transmit_ends(self, long long controller)
    cpdef int move_memory(self, words) except -1
    cpdef long long watched(self) noexcept
    cpdef long long latest_slot(self) noexcept
    cpdef object counters(self)
