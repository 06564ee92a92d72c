cimport cython

from ranger_sim.foundation.events cimport NEVER
from ranger_sim.plant.bridge cimport Bridge

cpdef enum:
    PWM_WRITE = 0
    WATCHDOG_EDGE = 1
    LOW_SIDE_WRITE = 2
    ROW = 5
    DRIVEN = 0
    HELD_OPEN = 1
    HELD_LOW = 2
    HELD_HIGH = 3

@cython.final
cdef class Drive(Bridge):
    # what a motor looks at in every step stands first, beside each other
    cdef public long long next_change_ns
    cdef public double duty, ripple
    cdef public bint is_open, sensed_lead_switches
    cdef public long long switching_leads, power_off_ns, count
    cdef public bint powered, enable2, enable6
    cdef public long long mr2, mr6, mr0, watchdog_ns
    cdef public long long[::1] changes
    cdef public long long capacity, power_losses
    cdef public long long held2, held6
    cdef public double healthy_duty
    cdef public bint healthy_open
    cpdef void hold_leg(self, long long leg, long long state) noexcept
    cpdef void _queue(self, long long time, long long kind, long long a, long long b, long long c) noexcept
    cpdef void apply(self, long long time) noexcept
    cpdef void _update(self) noexcept
    cdef void _switch(self, bint conducts, long long high2, long long high6) noexcept
