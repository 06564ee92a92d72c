from ranger_sim.boards.modules.network_time cimport NetworkTime

cimport cython

cpdef enum:
    CODES = 1024
    RING_MASK = 31
    MOST_WAITING = 32
    COUNT_MASK = 1023
    CODE_MASK = 0xFFFF
    BOARD_MASK = 0x3F
    BOARD_SHIFT = 16
    COUNT_SHIFT = 22

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
