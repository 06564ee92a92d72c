cimport cython

from ranger_sim.boards.modules.quadrature_decoder cimport QuadratureDecoder
from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.firmware_sim.peripherals.timer_capture cimport TimerCapture
from ranger_sim.foundation.events cimport EventQueue

cpdef enum:
    LONGEST_TIME = 0x7F000000
    IR_MR0 = 1
    IR_CR0 = 16
    CCR_BOTH_EDGES = 3
    CCR_BITS = 3
    WRAP = 30000
    EARLY = 15000

@cython.final
cdef class WrapCounter:
    cdef public TimerCapture timer
    cdef public long long cycles

@cython.final
cdef class EncoderCapture:
    cdef public Microcontroller chip
    cdef public TimerCapture timer
    cdef public WrapCounter wraps
    cdef public QuadratureDecoder decoder
    cdef public long long armed_level, channel, flag, edge_bits, pin, partner_pin
    cdef public long long last
