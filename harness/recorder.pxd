cdef class RowStream:
    cdef public long long columns, block_rows, capacity, used, rows, last_time_ns
    cdef public long long[::1] integers
    cdef public double[::1] reals
    cdef public bint is_real
    cdef public object digest, sink
    cpdef void finish_row(self, long long time_ns)
    cpdef void flush(self)

cdef class Recorder:
    cdef public RowStream frames, samples, words
    cpdef void frame(
        self, long long time_ns, long long bus, long long identifier, long long flags,
        long long word0, long long word1,
    )
