cimport cython

from libc.math cimport exp, sin
from ranger_sim.plant.friction cimport smoothed_sign
from ranger_sim.plant.leg cimport Leg

cpdef enum:
    STRIBECK = 0
    COULOMB = 1
    VISCOUS = 2
    DIRECTION = 3
    DRAG = 4
    SPRING = 5
    COGGING = 6
    COMMUTATION = 7
    TURN = 8
    STIFFENING = 9
    BACKLASH = 10
    SLACK = 11
    CABLE_DAMPING = 12
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
    cpdef double torque(self, long long i, double q, double w, double gear, double drive)
    cpdef double torque_on_hip(self, double h, double h_rate, double drive)
    cpdef int act_on_ankle(self, Leg leg, double angle, double rate, double motor, double motor_rate) except -1
