cimport cython

from libc.math cimport cos, sin
from ranger_sim.plant.mechanics.friction cimport smoothed_sign

@cython.final
cdef class Steering:
    cdef public double twist, rate, yaw, path_x, path_y, hip_x, known_yaw, sin_yaw, cos_yaw
    cdef public double rotor_inertia, swing_inertia, stance_inertia, stiffness, damping, stop
    cpdef void begin(self, double hip_x) noexcept
    cpdef void advance(self, double h, double drive, double coulomb, double viscous, double inverse_smoothing, bint outer_stands, bint inner_stands, double hip_x) noexcept
