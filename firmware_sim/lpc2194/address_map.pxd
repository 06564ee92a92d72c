cimport cython

from ranger_sim.firmware_sim.arm7.core cimport Device
from ranger_sim.firmware_sim.lpc2194.block cimport Block
from ranger_sim.firmware_sim.lpc2194.board cimport ImageBoard

cpdef enum:
    BLOCK_BITS = 14
    BLOCKS = 128

@cython.final
cdef class AddressMap(Device):
    cdef public ImageBoard board
    cdef public list places
    cdef public Block fast_gpio, vic
    cdef public long long touched, looks
    cpdef Block find(self, long long address)
    @cython.locals(offset=cython.longlong, value=cython.longlong)
    cpdef long long peek(self, long long address, long long size) except? <long long>-1
