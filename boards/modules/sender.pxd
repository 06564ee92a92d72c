from ranger_sim.boards.modules.network_time cimport NetworkTime
from ranger_sim.foundation.numbers cimport word_of_float, word_of_i32

cdef class Sender:
    cdef public NetworkTime time
    cdef public long long late_cycles
    cpdef bint send_words(self, long long identifier, long long value_word, long long time_word) except? -1
    cpdef int build(self, long long identifier, long long value_word, long long time_word) except -1
    cpdef bint send_float(self, long long identifier, double value) except? -1
    cpdef bint send_int(self, long long identifier, long long value) except? -1
