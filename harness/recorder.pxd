cimport cython

@cython.final
cdef class RowStream:
    cdef public long long columns, block_rows, capacity, used, rows, last_time_ns
    cdef public long long[::1] integers
    cdef public double[::1] reals
    cdef public bint is_real
    cdef public object digest, sink
    cpdef long long finish_row(self, long long time_ns) except? <long long>-1
    cpdef object flush(self)

@cython.final
cdef class Recorder:
    cdef public RowStream frames, samples, words
    cpdef long long add_frames(self, long long bus, long long[::1] log, long long count) except? <long long>-1
