from ranger_sim.firmware_sim.microcontroller cimport EdgeLine, Microcontroller
from ranger_sim.foundation.events cimport EventQueue
from ranger_sim.harness.processes.channel cimport Bell, Mailbox, load
from ranger_sim.harness.processes.stage cimport Stage

cdef class RemoteBoard(Microcontroller):
    cdef public Microcontroller shadow
    cdef public object estimator
    cdef public long long[::1] block
    cdef public Bell ask, answer
    cdef public Mailbox to_board, from_board
    cdef public Stage stage
    cdef public bint posted, gone, follows_steps
    cdef public long long place, quiet_until, urgent_kinds, turns, reached
    cpdef long long edges_came(self) noexcept
    cdef void _send_edges(self, EdgeLine line)
    cpdef void begin(self, long long until)
    cpdef long long advance(self, long long until) except? -1
    cdef bint _urgent(self, long long until) noexcept
    cdef void _post(self, long long command, long long until)
    cdef int _ring(self, long long command, long long until) except -1
    cdef bint _collect(self) except? -1
