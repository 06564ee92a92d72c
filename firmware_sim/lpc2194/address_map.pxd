cimport cython

from ranger_sim.firmware_sim.lpc2194.block cimport Block
from ranger_sim.firmware_sim.lpc2194.board cimport ImageBoard

cpdef enum:
    BLOCK_BITS = 14
    BLOCKS = 128

@cython.final
cdef class AddressMap:
    cdef public ImageBoard board
    cdef public list places
    cdef public Block fast_gpio, vic
    cdef public long long touched, looks
    cpdef Block find(self, long long address)
    cpdef long long read(self, long long address, long long size) except? <long long>-1
    @cython.locals(offset=cython.longlong, value=cython.longlong)
    cpdef long long peek(self, long long address, long long size) except? <long long>-1
    cpdef int write(self, long long address, long long size, long long value) except -1
