cdef class Keypad:
    cdef public object gpio
    cdef public long long[::1] pins
    cdef public object report
    cdef public long long code_index
    cpdef bint pressed(self, long long key)
    cpdef long long buttons(self)
