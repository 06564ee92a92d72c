cdef class Debounce:
    cdef public long long equal_samples, last, run, state
    cpdef void sample(self, long long level)

cdef class FootContact:
    cdef public long long on_level, off_level, level
    cdef public Debounce contact
    cpdef void sample(self, long long counts)
