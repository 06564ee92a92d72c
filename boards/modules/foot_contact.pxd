cdef class Debounce:
    cdef public long long equal_samples, last, run, state
    cpdef int sample(self, long long level) except -1

cdef class FootContact:
    cdef public long long on_level, off_level, level
    cdef public Debounce contact
    cpdef int sample(self, long long counts) except -1
