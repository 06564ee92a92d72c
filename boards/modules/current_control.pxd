from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.boards.modules.mcu_led cimport GREEN, McuLed
from ranger_sim.boards.modules.motor_limits cimport MotorLimits
from ranger_sim.boards.modules.motor_output cimport STOPPED, MotorOutput

cimport cython

cpdef enum:
    START_CALLS = 2
    ONE = 65536

@cython.final
cdef class CurrentControl:
    cdef public MotorLimits limits
    cdef public MotorOutput output
    cdef public bint block_positive, block_negative
    cdef public long long calls, integral, integral_limit, proportional_gain, integral_gain, duty
    cdef public McuLed leds
    cdef public ErrorModule errors
    cdef public long long code_saturated, code_sum, code_duty, code_stopped
    cpdef bint supervise(self, long long current) except? -1
    cpdef int update(self, long long target, long long current) except -1
