from libc.math cimport fabs
from ranger_sim.plant.mechanics.body cimport DOUBLE, FLIGHT, SINGLE, Body
from ranger_sim.plant.mechanics.contact_equations cimport APART, SLIDES_BACK, SLIDES_ON, STICKS, ContactEquations
from ranger_sim.plant.walking.impact cimport collide, take_states
from ranger_sim.plant.mechanics.leg cimport Leg
from ranger_sim.plant.walking.lift_off cimport leave
from ranger_sim.plant.mechanics.sliding cimport slide, write_forces
from ranger_sim.plant.mechanics.stance cimport on_feet

cpdef enum:
    NO_EVENT = 0
    TOUCH = 1
    LIFT_OFF = 2
    SLIDE = 3
    STICK = 4

cdef bint asks_too_much(Body body) noexcept
cdef bint near_the_bounds(Body body) noexcept
cdef double margin(Body body, Leg leg) noexcept
cdef double grip_witness(Body body, double value) except? -1
cpdef bint regrip(Body body) except? -1
cdef void allow(Body body, Leg leg) noexcept
cdef bint jam(Body body) except? -1
cdef bint take_grip(Body body) except? -1
