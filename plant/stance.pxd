from libc.math cimport cos, sin
from ranger_sim.plant.body cimport Body
from ranger_sim.plant.friction cimport smoothed_sign

cpdef void on_feet(Body body, double h, long long stages)
