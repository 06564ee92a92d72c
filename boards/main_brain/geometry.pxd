from libc.math cimport asin, atan, cos, sin, sqrt

cdef class FloorGeometry:
    cdef public double leg_m, inner_radius_m, inner_ankle_m, outer_radius_m, outer_ankle_m
    cdef public double front_foot, rear_foot, front_leg, rear_leg, ankle_distance_m
    cpdef bint solve(self, double hip, double outer, double inner) except? -1
