from libc.math cimport fabs
from ranger_sim.plant.mechanics.body cimport DOUBLE, FALLEN, FLIGHT, SINGLE, Body
from ranger_sim.plant.mechanics.leg cimport Leg
from ranger_sim.plant.mechanics.observed cimport Observed

cpdef int watch(Body body, double h) except -1
cdef void arm(Leg leg) noexcept
cdef int watch_swing_foot(Body body, double h) except -1
cpdef void keep_forces(Body body, double h) noexcept
cdef bint slips(Body body, Leg leg) noexcept
cdef int judge_fall(Body body) except -1
cpdef int fall(Body body, cause) except -1
