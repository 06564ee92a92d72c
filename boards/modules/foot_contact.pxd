cimport cython

cdef class Debounce:
    cdef public short settled, state, last, run, equal_samples
    cpdef void sample(self, long long level) noexcept

@cython.final
cdef class FootContact(Debounce):
    cdef public short level, on_level, off_level
    cpdef void read(self, long long counts) noexcept
