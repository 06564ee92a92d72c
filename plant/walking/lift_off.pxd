from ranger_sim.plant.mechanics.air cimport in_air
from ranger_sim.plant.mechanics.body cimport DOUBLE, FLIGHT, SINGLE, Body
from ranger_sim.plant.mechanics.leg cimport Leg
from ranger_sim.plant.mechanics.stance cimport on_feet

cdef bint may_leave(Body body, Leg leg) noexcept
cdef bint sole_ready(Body body, Leg leg) noexcept
cpdef bint lets_go(Body body, Leg leg) except? -1
cdef int leave(Body body, Leg leg) except -1
