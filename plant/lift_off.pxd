from libc.math cimport cos, sin
from ranger_sim.plant.air cimport in_air
from ranger_sim.plant.body cimport Body
from ranger_sim.plant.stance cimport on_feet

cdef bint may_leave(Body body, long long leg) noexcept
cdef bint sole_ready(Body body, long long leg) noexcept
cpdef bint lets_go(Body body, long long leg) except? -1
cdef double rise(Body body, long long leg) noexcept
cdef int leave(Body body, long long foot) except -1
