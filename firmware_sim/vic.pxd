cimport cython

from foundation.events cimport EventQueue

@cython.final
cdef class InterruptSource:
    cdef public long long kind, index
    cdef public str name
    cdef public object handler
    cdef public long long cost, per_item, latency, slot, bit
    cdef public long long base_cycles, base_ns, latency_ns
    cdef public bint attached, pending, keeps_message
    cdef public long long requests, merged, served, total_cycles, max_cycles
    cdef public long long time, order, a, b, c, d, e, f
    cdef public object ref
    cpdef int keep_message(self, EventQueue queue) except -1
    cpdef int give_message(self, EventQueue queue) except -1

@cython.final
cdef class InterruptController:
    cdef public double ns_per_cycle
    cdef public dict sources
    cdef public list fiq_list, irq_list
    cdef public long long pending
    cdef public InterruptSource newest
    cpdef InterruptSource source(self, long long kind, long long index)
    cpdef InterruptSource first_pending(self)
    cpdef bint raise_source(self, InterruptSource source) noexcept
