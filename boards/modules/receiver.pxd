from foundation.numbers cimport fixed_of_float, float_of_word, wrap_i32

cdef class Receiver:
    cdef public long long frames
    cpdef void deliver(self, long long value_word, long long time_word)

cdef class FloatReceiver(Receiver):
    cdef public double value
    cdef public long long fixed

cdef class IntReceiver(Receiver):
    cdef public long long value

cdef class Ignored(Receiver):
    pass
