from ranger_sim.boards.modules.receiver cimport IntReceiver
from ranger_sim.firmware_sim.peripherals.gpio cimport Gpio
from ranger_sim.firmware_sim.peripherals.pwm cimport Pwm
from ranger_sim.foundation.numbers cimport wrap_i32

cimport cython

cpdef enum:
    PERIOD_COUNTS = 600
    SLEEP = 1
    SHUTDOWN = 2
    STOPPED = 4
    OFF_UNLESS_0 = 0x7FFF

@cython.final
cdef class OffRequest(IntReceiver):
    cdef public MotorOutput output
    cdef public long long bit

@cython.final
cdef class MotorOutput:
    cdef public bint second_pattern
    cdef public long long off, watchdog_pin, low_side_2_pin, low_side_6_pin
    cdef public Gpio gpio
    cdef public Pwm pwm
    cdef public long long sign, largest, offset, low_side, duty
    cdef public OffRequest sleep, shutdown
    cpdef int feed_watchdog(self) except -1
    cpdef int enable_low_side(self, long long on) except -1
    cpdef int write(self, long long duty) except -1
