from ranger_sim.plant.body cimport DOUBLE, FALLEN, FLIGHT, SINGLE, Body
from ranger_sim.plant.leg cimport Leg
from ranger_sim.plant.lift_off cimport leave
from ranger_sim.plant.sliding cimport slide

cpdef enum:
    PARTS = 10

cdef int press(Body body, double h) except -1
cdef int meet(Body body, Leg leg, double before) except -1
cdef int stand(Body body, Leg leg, double ahead) except -1
