cimport cython

from ranger_sim.firmware_sim.chip cimport ALARMS, Chip
from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.vic cimport InterruptSource
from ranger_sim.foundation.events cimport NEVER

@cython.final
cdef class Alarm:
    cdef public Chip chip
    cdef public Peripheral owner
    cdef public long long number, place, time
    cpdef long long set(self, long long time) noexcept
    @cython.final
    cdef long long _set_again(self, long long time) noexcept
    @cython.final
    cdef void _move(self, long long a, long long b) noexcept
    @cython.final
    cdef InterruptSource ring(self, long long time)

@cython.final
cdef class SlotTimer(Peripheral):
    cdef public Alarm alarm
