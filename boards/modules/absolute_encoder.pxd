from boards.modules.error_module cimport ErrorModule

cdef class AbsoluteEncoder:
    cdef public long long zero, sign, largest_step
    cdef public ErrorModule errors
    cdef public long long spike_code, value, counts, angle
    cpdef int accept(self, long long word) except -1
    cpdef double angle_rad(self)
