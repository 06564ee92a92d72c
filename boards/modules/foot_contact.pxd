cimport cython

@cython.final
cdef class Debounce:
    cdef public long long equal_samples, last, run, state, settled
    cpdef void sample(self, long long level) noexcept

@cython.final
cdef class FootContact:
    cdef public long long on_level, off_level, level
    cdef public Debounce contact
    cpdef void sample(self, long long counts) noexcept
