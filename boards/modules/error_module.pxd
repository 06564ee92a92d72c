from boards.modules.network_time cimport NetworkTime

cimport cython

@cython.final
cdef class ErrorModule:
    cdef public long long board
    cdef public NetworkTime time
    cdef public bint per_event, lose_new_after_repeat
    cdef public long long[::1] totals, flags, flagged, codes, counts, stamps
    cdef public long long flagged_count, first, waiting, dropped, word, stamp
    cpdef void report(self, long long code) noexcept
    cpdef object update(self)
    cpdef bint take(self) noexcept
