from boards.modules.foot_contact cimport Debounce
from firmware_sim.peripherals.gpio cimport Gpio

cimport cython

@cython.final
cdef class LimitSwitch:
    cdef public Gpio gpio
    cdef public long long pin
    cdef public Debounce switch
    cpdef void sample(self) noexcept
