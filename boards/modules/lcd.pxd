from ranger_sim.boards.modules.receiver cimport Receiver

cdef class CharacterDisplay:
    cdef public long long[::1] memory
    cdef public long long address, commands, characters
    cdef public bint on, two_lines, wide_bus
    cdef public long long increment
    cpdef int command(self, long long byte) except -1
    cpdef int data(self, long long byte) except -1

cdef class Lcd:
    cdef public long long countdown, state, waiting, position, character
    cdef public CharacterDisplay display
    cdef public object report
    cdef public long long[::1] positions, characters, reads, counts
    cdef public long long code_full, code_position
    cdef public long long written, lost
    cpdef bint put(self, long long position, long long character) except? -1
    cpdef long long set_quarter(self, long long quarter, long long word) except? -1
    cpdef long long tick(self) except? -1

cdef class LcdQuarter(Receiver):
    cdef public Lcd lcd
    cdef public long long quarter
