from ranger_sim.plant.mechanics.air cimport in_air
from ranger_sim.plant.mechanics.body cimport DOUBLE, FALLEN, HELD, SINGLE, Body
from ranger_sim.plant.walking.compliant cimport press
from ranger_sim.plant.walking.grip cimport (
    LIFT_OFF, NO_EVENT, SLIDE, STICK, TOUCH, asks_too_much, grip_witness, near_the_bounds, regrip,
)
from ranger_sim.plant.walking.impact cimport touch
from ranger_sim.plant.mechanics.leg cimport Leg
from ranger_sim.plant.walking.lift_off cimport leave, lets_go, may_leave, sole_ready
from ranger_sim.plant.mechanics.sliding cimport slide
from ranger_sim.plant.mechanics.stance cimport on_feet
from ranger_sim.plant.walking.watch cimport watch

cpdef enum:
    MOST_EVENTS = 20
    MOST_TRIES = 60

cpdef int advance(Body body, double h) except -1
cdef int move(Body body, double h) except -1
cdef bint change_grip(Body body, double h) except? -1
cdef bint let_pulled_foot_go(Body body, double h) except? -1
cdef double clearance(Leg leg) noexcept
cdef bint free_to_leave(Body body, Leg leg) except? -1
cdef double witness(Body body) except? -1
cdef double touch_witness(Body body) noexcept
cdef double try_piece(Body body, double h) except? -1
cdef double locate(Body body, double h) except? -1
cdef int act(Body body) except -1
