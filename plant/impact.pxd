from libc.math cimport cos, fabs, sin
from ranger_sim.plant.body cimport DOUBLE, FLIGHT, SINGLE, Body
from ranger_sim.plant.leg cimport Leg

cpdef enum:
    COLUMN_VX = 0
    COLUMN_VY = 1
    COLUMN_LEG = 2
    COLUMN_FOOT = 4
    COLUMN_IMPULSE = 6
    COLUMN_RIGHT = 10
    COLUMNS = 11

cdef int touch(Body body, Leg leg) except -1
cdef void set_down(Body body, Leg leg) noexcept
cdef int land(Body body, Leg leg) except -1
cdef int close_linkage(Body body, Leg leg) except -1
cpdef int impact(Body body, bint outer, bint inner) except -1
cdef int write_momentum(Body body) except -1
cdef void write_foot_at_rest(Body body, Leg leg, long long row) noexcept
cdef void write_foot_with_motor(Body body, Leg leg) noexcept
cdef void eliminate(Body body, long long n) noexcept
