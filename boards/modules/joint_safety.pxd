from ranger_sim.boards.modules.absolute_encoder cimport AbsoluteEncoder
from ranger_sim.boards.modules.current_control cimport CurrentControl
from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.boards.modules.limit_switch cimport LimitSwitch
from ranger_sim.boards.modules.mcu_led cimport GREEN, RED, McuLed
from ranger_sim.boards.modules.quadrature_decoder cimport QuadratureDecoder
from ranger_sim.foundation.numbers cimport float32

cimport cython

cpdef enum:
    HIP_LIMIT_COUNTS = 800
    FLASH_MS = 100

@cython.final
cdef class HipSafety:
    cdef public AbsoluteEncoder encoder
    cdef public CurrentControl control
    cdef public McuLed leds

@cython.final
cdef class AnkleSafety:
    cdef public AbsoluteEncoder encoder
    cdef public QuadratureDecoder motor
    cdef public LimitSwitch left, right
    cdef public CurrentControl control
    cdef public McuLed leds
    cdef public ErrorModule errors
    cdef public double low, high, stretch
    cdef public long long code_switch, code_stretch, code_low, code_high
