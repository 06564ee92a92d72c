cimport cython

from ranger_sim.boards.modules.quadrature_decoder cimport QuadratureDecoder
from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.firmware_sim.peripherals.timer_capture cimport TimerCapture
from ranger_sim.foundation.events cimport EventQueue

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
