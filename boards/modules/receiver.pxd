from ranger_sim.foundation.numbers cimport fixed_of_float, float_of_word, wrap_i32

cimport cython

cdef class Receiver:
    cdef public long long frames, cycles
    cpdef int deliver(self, long long value_word, long long time_word) except -1

@cython.final
cdef class FloatReceiver(Receiver):
    cdef public double value
    cdef public long long fixed

cdef class IntReceiver(Receiver):
    cdef public long long value

@cython.final
cdef class Ignored(Receiver):
    pass
