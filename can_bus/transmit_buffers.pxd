from ranger_sim.foundation.events cimport NEVER

cimport cython

cpdef enum:
    BUFFERS = 3
    FREE_AT = 0
    READY = 1
    ASKED = 2
    NEXT = 3
    IDENTIFIER = 4
    FLAGS = 5
    LOW = 6
    HIGH = 7
    ROW = 8
    BUFFER_SHIFT = 3
    BUFFER_MASK = 3
    NODE_SHIFT = 5

@cython.final
cdef class TransmitBuffers:
    cdef long long* slots
    cdef public long long first, waiting_count
    # what the address `slots` leads into: exchanged only by `add_node`, which sets both
    cdef readonly long long[::1] rows

    cdef void remove(self, long long row) noexcept
    cdef long long first_ready(self) noexcept
