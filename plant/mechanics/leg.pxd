cimport cython

from libc.math cimport cos, sin

cpdef enum:
    OUTER = 0
    INNER = 1

@cython.final
cdef class Leg:
    # what every step looks at stands first, beside each other
    cdef public double foot_angle, angle, motor_angle, foot_rate, rate, motor_rate
    cdef public double known_foot, sin_foot, cos_foot, known_angle, sin_leg, cos_leg
    cdef public double drive, coulomb, viscous
    cdef public double Fx, Fy, foot_acc, acc, motor_acc
    cdef public double anchor, height, gap
    cdef public double hip_sign, el, r, d, heel, toe, Jf, inverse_Jf, C
    cdef public double mc, mw, mt, m22, i33, J
    cdef public double extra_ankle, extra_motor, impulse_x, impulse_y
    cdef public long long side, slide
    cdef public bint armed
    cdef public double[6] saved
    cdef void know_leg(self) noexcept
    cdef void know_foot(self) noexcept
    cpdef double excess(self, double foot) noexcept
    cpdef double chain_x(self, double foot, double leg) noexcept
    cpdef double chain_y(self, double foot, double leg) noexcept
    cdef double reach(self) noexcept
    cpdef double behind(self) noexcept
    cdef double rise(self) noexcept
    cpdef double stretch(self) noexcept
    cpdef void limp(self) noexcept
    cpdef void lie(self) noexcept
    cdef void save(self) noexcept
    cdef void restore(self) noexcept
