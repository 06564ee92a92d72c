cimport cython

@cython.final
cdef class EdgeBuffer:
    cdef public long long count, read
    cdef long long* packed
    cdef public long long capacity
    cdef readonly long long[::1] kept
    cpdef int _keep(self, storage) except -1
    cpdef void clear(self) noexcept
    cpdef int grow(self) except -1
    cpdef void push(self, long long time, long long level_a, long long level_b) noexcept

@cython.final
cdef class ByteBuffer:
    cdef public long long capacity, count
    cdef public long long[::1] times, values
    cpdef void clear(self) noexcept
    cpdef int grow(self) except -1
    cpdef void push(self, long long time, long long value) noexcept
