from libc.math cimport fabs
from ranger_sim.plant.body cimport Body

cpdef int watch(Body body, double h) except -1
cdef int watch_swing_foot(Body body, double h) except -1
cpdef void keep_forces(Body body, double h) noexcept
cdef int judge_fall(Body body) except -1
cpdef int fall(Body body, cause) except -1
