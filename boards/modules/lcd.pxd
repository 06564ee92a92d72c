cdef class CharacterDisplay:
    cdef public long long[::1] memory
    cdef public long long address, commands, characters
    cdef public bint on, two_lines, wide_bus
    cdef public long long increment
    cpdef void command(self, long long byte)
    cpdef void data(self, long long byte)

cdef class Lcd:
    cdef public CharacterDisplay display
    cdef public object report
    cdef public long long[::1] positions, characters, reads, counts
    cdef public long long state, countdown, position, character, waiting
    cdef public long long code_full, code_position
    cdef public long long written, lost
    cpdef bint put(self, long long position, long long character)
    cpdef long long set_quarter(self, long long quarter, long long word)
    cpdef long long set_quarter_1(self, long long word0, long long word1)
    cpdef long long set_quarter_2(self, long long word0, long long word1)
    cpdef long long set_quarter_3(self, long long word0, long long word1)
    cpdef long long set_quarter_4(self, long long word0, long long word1)
    cpdef long long tick(self)
