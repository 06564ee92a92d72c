from boards.modules.receiver cimport IntReceiver
from firmware_sim.peripherals.gpio cimport Gpio
from firmware_sim.peripherals.pwm cimport Pwm

cimport cython

@cython.final
cdef class MotorOutput:
    cdef public Gpio gpio
    cdef public Pwm pwm
    cdef public IntReceiver sleep, shutdown
    cdef public bint stopped, second_pattern
    cdef public long long sign, largest, offset, low_side, duty
    cdef public short watchdog_pin, low_side_2_pin, low_side_6_pin
    cpdef bint asleep(self) noexcept
    cpdef bint is_shut_down(self) noexcept
    cpdef bint running(self) noexcept
    cpdef int feed_watchdog(self) except -1
    cpdef int enable_low_side(self, long long on) except -1
    cpdef int write(self, long long duty) except -1
