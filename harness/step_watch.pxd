cdef class StepWatch:
    cdef public long long seen_ns
    cpdef object before_step(self, long long now_ns)
    cpdef object after_step(self, long long start_ns, long long end_ns)

cdef class StepEnd:
    cpdef object look(self)

cdef class SerialDevice:
    cpdef object deliver(self)
