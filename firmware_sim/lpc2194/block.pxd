cimport cython

from ranger_sim.firmware_sim.peripheral cimport Peripheral

@cython.final
cdef class Clocks:
    cdef public long long crystal_hz, cclk, divider

cdef class Block(Peripheral):
    cdef public Clocks clocks
    cdef public str name
    cdef public long long base, mask
    cdef public bint steady
    cdef public Block partner
    cpdef long long read(self, long long offset) except? <long long>-1
    cpdef int write(self, long long offset, long long value) except -1
    cpdef int write_part(self, long long offset, long long size, long long value) except -1
    cpdef long long requests(self) except? <long long>-1
    cpdef object clocked(self)
    cdef long long unknown(self, long long offset, bint writing) except? <long long>-1
    cpdef object not_modelled(self, what)
