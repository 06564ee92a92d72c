from ranger_sim.boards.modules.error_module cimport ErrorModule

cimport cython

cpdef enum:
    RAD_PER_COUNT_SHIFTED = 3294206
    WORD_MASK = 0x1FFF
    COUNTS_PER_TURN = 8192
    SLOTS_PER_MINUTE = 120000
    SPARE_COUNTS = 5

cdef double RAD_PER_COUNT

@cython.final
cdef class AbsoluteEncoder:
    cdef public long long value, counts, angle, largest_step, sign, zero
    cdef public ErrorModule errors
    cdef public long long spike_code
    cpdef void accept(self, long long word) noexcept
    cpdef double angle_rad(self) noexcept
