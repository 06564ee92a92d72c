from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.foundation.numbers cimport fixed_of_float, float32

cimport cython

cpdef enum:
    WORD_MASK = 0x1FFF
    COUNTS_PER_TURN = 8192
    SLOTS_PER_MINUTE = 120000
    SPARE_COUNTS = 5

@cython.final
cdef class AbsoluteEncoder:
    cdef public long long value, counts, angle, largest_step, sign, zero
    cdef public double radians, rad_per_count
    cdef public ErrorModule errors
    cdef public long long spike_code
    cpdef void accept(self, long long word) noexcept
    cpdef double angle_rad(self) noexcept
