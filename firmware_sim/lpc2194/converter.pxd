cimport cython

from ranger_sim.firmware_sim.lpc2194.block cimport Block
from ranger_sim.firmware_sim.lpc2194.vic cimport ADC_INPUT
from ranger_sim.firmware_sim.peripherals.adc_internal cimport CONVERSION_CLOCKS, CR_BURST, GDR_RESULT_SHIFT, AdcInternal

cdef enum:
    CR_PDN_BIT = 0x200000
    START_SHIFT = 24
    GLOBAL_INTERRUPT = 0x100

cdef long long DONE

@cython.final
cdef class ConverterBlock(Block):
    cdef public AdcInternal adc
    cdef public long long control, inten, done
    cdef public bint seen
    cdef public long long[8] data, burst_read
    cdef void look(self) noexcept
    cpdef object _set_clock(self)
    cpdef long long _burst_result(self, channel) except? <long long>-1
    cpdef object _control(self, value)
