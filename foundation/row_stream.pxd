cimport cython

cdef class RowStream:
    cdef public long long used, capacity, last_time_ns, number
    cdef long long* numbers
    cdef public long long columns
    cdef readonly long long[::1] integers
    cdef public double[::1] reals
    cdef public bint is_real
    cdef public object digest, sink
    cpdef int finish_row(self, long long time_ns) except -1
    cpdef object flush(self)

@cython.final
cdef class FrameStream(RowStream):
    cpdef int add(self, long long time_ns, long long identifier, long long flags, long long lo, long long hi) except -1
