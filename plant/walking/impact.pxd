from ranger_sim.plant.mechanics.body cimport DOUBLE, FLIGHT, SINGLE, Body
from ranger_sim.plant.mechanics.contact_equations cimport (
    APART, COLUMN_FOOT, COLUMN_IMPULSE, COLUMN_LEG, COLUMN_VX, COLUMN_VY, SLIDES_BACK, SLIDES_ON, STICKS,
    ContactEquations,
)
from ranger_sim.plant.mechanics.leg cimport Leg

cdef int touch(Body body, Leg leg) except -1
cdef void set_down(Body body, Leg leg) noexcept
cdef int land(Body body, Leg leg) except -1
cdef int close_linkage(Body body, Leg leg) except -1
cpdef int impact(Body body, bint outer, bint inner) except -1
cpdef int collide(Body body, Leg leg, bint other_stands) except -1
cdef int take_states(Body body, Leg leg) except -1
cdef void take_slides(Body body) noexcept
cdef int write_momentum(Body body) except -1
cdef int take_rates(Body body) except -1
