from ranger_sim.foundation.row_stream cimport FrameStream, RowStream

cimport cython

cpdef enum:
    TIMES_COLUMNS = 7
    TIMES_START = 0
    TIMES_ASKED = 1
    TIMES_END = 2
    TIMES_IDENTIFIER = 3
    TIMES_SENDER = 4
    TIMES_LOW = 5
    TIMES_HIGH = 6
    TIMES_BUFFER_SHIFT = 8
    SENDER_SHIFT = 16

@cython.final
cdef class FrameTimes(RowStream):
    cpdef int add(
        self, long long start, long long asked, long long end, long long identifier, long long sender,
        long long lo, long long hi,
    ) except -1

@cython.final
cdef class FrameLog:
    cdef public FrameStream stream
    cdef public FrameTimes times
    cdef public list frames
    cdef public long long capacity, dropped

    cdef int add(
        self, long long time, long long identifier, long long flags, long long lo, long long hi, long long node
    ) except -1
