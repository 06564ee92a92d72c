cimport cython

from libc.math cimport cos, sin, sqrt

@cython.final
cdef class HipJoint:
    cdef public double drive, coulomb, viscous, k, J
    cdef public bint exact
    cdef public double exact_k, l0, ab, aabb
    cpdef double spring_torque(self, double angle) noexcept
    cpdef double spring_energy(self, double angle) noexcept

@cython.final
cdef class Ankle:
    cdef public double k, J, inverse_J, low, high, stop_k, stop_c, return_k, rest
    cpdef double stop_torque(self, double angle, double rate) noexcept

@cython.final
cdef class Sole:
    cdef public double k, c, per_m_s, mu, floor_k, floor_a, floor_per_m_s
