from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.foundation.events cimport EventQueue
from ranger_sim.harness.processes.channel cimport Bell, Mailbox
from ranger_sim.harness.processes.stage cimport Audience

cdef class Endpoint:
    cdef public Microcontroller board
    cdef public object estimator, router, totals, clock, shared
    cdef public long long[::1] block, stage
    cdef public double[::1] stage_doubles
    cdef public Bell ask, answer
    cdef public Mailbox to_board, from_board
    cdef public Audience audience
    cdef public EventQueue pending, out
    cdef public long long slots_seen, turns, reached, urgent_kinds, promised
    cpdef void serve(self)
    cdef void _advance(self)
    cdef int _run_to(self, long long until) except -1
    cdef void _late(self)
    cdef bint _put_out(self)
    cdef int _show(self) except -1
    cdef long long _next_output(self)
