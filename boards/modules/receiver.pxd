from foundation.numbers cimport fixed_of_float, float_of_word, wrap_i32

cimport cython

cdef class Receiver:
    cdef public long long frames
    cpdef void deliver(self, long long value_word, long long time_word)

@cython.final
cdef class FloatReceiver(Receiver):
    cdef public double value
    cdef public long long fixed

@cython.final
cdef class IntReceiver(Receiver):
    cdef public long long value

@cython.final
cdef class Ignored(Receiver):
    pass
