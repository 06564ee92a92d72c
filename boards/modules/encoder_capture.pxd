cimport cython

from boards.modules.quadrature_decoder cimport QuadratureDecoder
from firmware_sim.microcontroller cimport Microcontroller
from firmware_sim.peripherals.timer_capture cimport TimerCapture
from foundation.events cimport EventQueue

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
