from ranger_sim.foundation.row_stream cimport FrameStream

cimport cython

@cython.final
cdef class FrameLog:
    cdef public FrameStream stream
    cdef public list frames
    cdef public long long capacity, dropped

    cdef int add(
        self, long long time, long long identifier, long long flags, long long lo, long long hi, long long node
    ) except -1
