cimport cython

cdef class Debounce:
    cdef public long long settled, state, last, run, equal_samples
    cpdef void sample(self, long long level) noexcept
    cpdef long long contact(self) noexcept

@cython.final
cdef class FootContact(Debounce):
    cdef public long long level, on_level, off_level
    cpdef void read(self, long long counts) noexcept
