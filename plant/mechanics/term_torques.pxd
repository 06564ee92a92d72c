cimport cython

from libc.math cimport exp, sin
from ranger_sim.plant.mechanics.friction cimport smoothed_sign
from ranger_sim.plant.mechanics.leg cimport Leg

cpdef enum:
    STRIBECK = 0
    COULOMB = 1
    VISCOUS = 2
    DIRECTION = 3
    DRAG = 4
    SPRING = 5
    COGGING = 6
    TURN = 7
    STIFFENING = 8
    BACKLASH = 9
    SLACK = 10
    CABLE_DAMPING = 11
    HIP_JOINT = 0
    HIP_MOTOR = 1
    ANKLE_JOINT = 2
    ANKLE_MOTOR = 3
    ANKLE_CABLE = 4

@cython.final
cdef class TermTorques:
    cdef public long long count
    cdef public double zero_rad, hip_gear, ankle_gear, inverse_smoothing
    cdef public long long[::1] forms, places, sides
    cdef public double[::1] parameters
    cpdef double torque(self, long long i, double q, double w, double gear)
    cpdef double torque_on_hip(self, double h, double h_rate)
    cpdef int act_on_ankle(self, Leg leg, double angle, double rate, double motor, double motor_rate) except -1
