from ranger_sim.firmware_sim.peripheral cimport Peripheral

cimport cython

@cython.final
cdef class CharacterDisplay(Peripheral):
    cdef public long long[8] data_pins
    cdef public long long rs, rw, enable
    cdef public bint enabled, in_shapes, wide_bus, two_lines, on, follows
    cdef public long long[::1] memory
    cdef public long long address, increment, shift, half, commands, characters
    cpdef bint on_enable(self, long long level) except? -1
    cdef int _read_out(self) except -1
    cpdef int write(self, long long rs, long long byte) except -1
    cdef int _instruct(self, long long byte) except -1
    cdef int _move_on(self) except -1
    cdef long long _beside(self, long long address, long long step) noexcept
    cpdef long long shown(self, long long line, long long place) except? <long long>-1
