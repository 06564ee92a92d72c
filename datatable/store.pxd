from ranger_sim.foundation.numbers cimport float_of_word, word_of_float, wrap_i32

cimport cython

cdef long long _MASK

@cython.final
cdef class DataStore:
    cdef public long long size
    cdef public long long[::1] words
    cdef public long long[::1] stamps
    cdef public unsigned char[::1] unread
    cdef public long long out_of_range_count, out_of_range_id
    cdef public object on_out_of_range

    cpdef int move(self, words) except -1
    cpdef bint has(self, long long number) except? -1
    cpdef bint set_word(self, long long number, long long word, long long stamp) except? -1
    cpdef long long get_word(self, long long number) except? <long long>-1
    cpdef bint set_float(self, long long number, double value) except? -1
    cpdef double get_float(self, long long number) except? -1
    cpdef bint set_int(self, long long number, long long value) except? -1
    cpdef long long get_int(self, long long number) except? <long long>-1
    cpdef bint set_u32(self, long long number, long long value) except? -1
    cpdef long long get_u32(self, long long number) except? <long long>-1
    cpdef long long stamp(self, long long number) except? <long long>-1
    cpdef long long network_time_ms(self) noexcept
    cpdef long long age_ms(self, long long number, long long now) except? <long long>-1
    cpdef bint is_unread(self, long long number, long long subscriber) except? -1
    cpdef bint mark_read(self, long long number, long long subscriber) except? -1
    cpdef bint mark_unread(self, long long number) except? -1
    cpdef long long next_unread(self, long long[::1] numbers, long long start, long long subscriber) except? <long long>-1
