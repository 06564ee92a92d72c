from ranger_sim.boards.modules.network_time cimport NetworkTime

cimport cython

@cython.final
cdef class ErrorModule:
    # what every slot looks at
    cdef public long long flagged_count, waiting
    # what an error touches
    cdef public NetworkTime time
    cdef public bint per_event, lose_new_after_repeat
    cdef public long long first, dropped, word, stamp, board
    cdef public long long[32] codes, counts
    cdef public long long[32] stamps
    cdef public long long[::1] totals, flags, flagged
    cpdef void report(self, long long code) noexcept
    cpdef object update(self)
    cpdef bint take(self) noexcept
