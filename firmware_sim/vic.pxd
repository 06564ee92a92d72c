cimport cython

from ranger_sim.foundation.events cimport EventQueue
from ranger_sim.firmware_sim.scheduler cimport call_with, code_of, owner_of

cpdef enum:
    FIQ = -1
    IRQ_SLOTS = 16
    FIRST_FIQ = 65536

# What the handler returns for the message in the fields of `queue`.
cdef inline object handle(InterruptSource source, EventQueue queue):
    return call_with(source.code, source.owner, queue)

# In both classes the fields that every request and every service touches come first, close together.
@cython.final
cdef class InterruptSource:
    cdef public long long bit, code, owner, latency_ns, base_ns, base_cycles, served, per_item
    cdef public long long requested, noted, noted_cycles, noted_most, merged, forgotten
    cdef public object handler, service
    cdef public InterruptController controller
    cdef public long long kind, index, number, cost, latency, slot
    cdef public str name
    cdef public long long time, order, a, b, c, d, e, f
    cdef public object ref
    @cython.final
    cdef void note(self, long long cycles) noexcept
    cpdef int keep_message(self, EventQueue queue) except -1
    cpdef int give_message(self, EventQueue queue) except -1

@cython.final
cdef class InterruptController:
    cdef public long long pending
    cdef public InterruptSource newest
    cdef public list fiq_list, irq_list
    cdef public double ns_per_cycle
    cdef public dict sources
    cpdef InterruptSource source(self, long long kind, long long index)
    cpdef InterruptSource take_first(self)
    cpdef bint raise_source(self, InterruptSource source, long long time) noexcept
