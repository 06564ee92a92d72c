cimport cython

@cython.final
cdef class Observed:
    cdef public bint foothold_due, brushing
    cdef public double passing_gap, scuff_time_s, brush_s, released_s
    cdef public double friction_ratio_max, slip_s, normal_force_min, pull_s
    cdef public double fall_lean, fall_height, fall_split, stall_s
    cpdef void begin(self, double time_s) noexcept
