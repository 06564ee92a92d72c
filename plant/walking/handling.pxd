from ranger_sim.plant.mechanics.body cimport HELD, SINGLE, Body
from ranger_sim.plant.mechanics.leg cimport OUTER, Leg
from ranger_sim.plant.walking.watch cimport fall

cpdef int place(Body body, double outer_leg_rad, double hip_rad) except -1
cpdef int hold(Body body, double outer_leg_rad) except -1
cpdef int hold_both(Body body, double outer_leg_rad, double hip_rad) except -1
cpdef int hold_standing(Body body, double outer_leg_rad, double hip_rad, long long stance=*) except -1
cpdef int release(
    Body body, double outer_leg_rate, long long stance=*, double stance_foot_rate=*, double hip_rate=*,
) except -1
cpdef int begin_walk(Body body) except -1
