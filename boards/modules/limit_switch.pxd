from ranger_sim.boards.modules.foot_contact cimport Debounce
from ranger_sim.firmware_sim.microcontroller cimport Microcontroller

cimport cython

@cython.final
cdef class LimitSwitch(Debounce):
    cdef public Microcontroller chip
    cdef public long long pin
    cpdef void read(self) noexcept
