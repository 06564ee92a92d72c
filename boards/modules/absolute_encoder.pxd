from ranger_sim.boards.modules.error_module cimport ErrorModule

cimport cython

@cython.final
cdef class AbsoluteEncoder:
    cdef public long long value, counts, angle, largest_step, sign, zero
    cdef public ErrorModule errors
    cdef public long long spike_code
    cpdef void accept(self, long long word) noexcept
    cpdef double angle_rad(self) noexcept
