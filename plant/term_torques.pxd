cimport cython

from libc.math cimport exp, sin
from ranger_sim.plant.friction cimport smoothed_sign

@cython.final
cdef class TermTorques:
    cdef public long long count
    cdef public double zero_rad, hip_gear, ankle_gear, inverse_smoothing
    cdef public long long[::1] forms, places
    cdef public double[::1] parameters
    cpdef double torque(self, long long i, double q, double w, double gear, double drive)
    cpdef void joint_torques(
        self, object body, double h, double h_rate, double outer, double outer_rate, double inner, double inner_rate,
        double outer_motor, double outer_motor_rate, double inner_motor, double inner_motor_rate,
    )
