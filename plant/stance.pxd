from libc.math cimport cos, sin
from plant.body cimport Body
from plant.friction cimport smoothed_sign

cpdef void on_feet(Body body, double h, long long stages)
