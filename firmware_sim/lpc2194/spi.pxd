cimport cython

from ranger_sim.firmware_sim.lpc2194.block cimport Block
from ranger_sim.firmware_sim.lpc2194.vic cimport SPI0_INPUT
from ranger_sim.firmware_sim.peripherals.spi_encoder cimport SPSR_SPIF, SpiEncoder

cpdef enum:
    CR_BIT_ENABLE = 0x04
    CR_MASTER = 0x20
    CR_INTERRUPT = 0x80

@cython.final
cdef class SpiBlock(Block):
    cdef public SpiEncoder spi
    cdef public long long CR, CCR, SPINT
    cdef public bint under_way, status_read
    cpdef object _transfer(self)
