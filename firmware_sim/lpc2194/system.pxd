cimport cython

from ranger_sim.firmware_sim.lpc2194.block cimport Block
from ranger_sim.firmware_sim.lpc2194.vic cimport EINT0_INPUT
from ranger_sim.firmware_sim.peripherals.adc_external cimport Ads7871

cpdef enum:
    EINTS = 4

@cython.final
cdef class SystemBlock(Block):
    cdef public Ads7871 converter
    cdef public long long EXTINT, EXTMODE, EXTPOLAR
    cdef public long long[4] levels
    cdef public dict plain
    cdef public long long MAMCR, MAMTIM, feed, lock_ns
    cdef public tuple active
    cdef void _clear(self, long long flags) noexcept
    cpdef object _feed(self, value)
    cpdef object _set_clock(self)
    cpdef object _accelerate(self, offset, value)
