from ranger_sim.plant.mechanics.body cimport DOUBLE, FALLEN, FLIGHT, SINGLE, Body
from ranger_sim.plant.mechanics.leg cimport Leg
from ranger_sim.plant.walking.lift_off cimport leave
from ranger_sim.plant.mechanics.sliding cimport slide

cpdef enum:
    PARTS = 10

cdef int press(Body body, double h) except -1
cdef int meet(Body body, Leg leg, double before) except -1
cdef int stand(Body body, Leg leg, double ahead) except -1
