from ranger_sim.plant.air cimport in_air
from ranger_sim.plant.body cimport Body
from ranger_sim.plant.impact cimport touch
from ranger_sim.plant.lift_off cimport leave, lets_go, may_leave, sole_ready
from ranger_sim.plant.stance cimport on_feet
from ranger_sim.plant.watch cimport watch

cpdef int advance(Body body, double h) except -1
cdef bint let_pulled_foot_go(Body body, double h) except? -1
cdef double crossed(Body body) except? -1
cdef double try_piece(Body body, double h) except? -1
cdef double locate(Body body, double h) except? -1
cdef int act(Body body) except -1
