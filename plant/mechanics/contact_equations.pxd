cimport cython

from libc.math cimport cos, fabs, sin
from ranger_sim.plant.mechanics.leg cimport INNER, OUTER, Leg

cpdef enum:
    COLUMN_VX = 0
    COLUMN_VY = 1
    COLUMN_LEG = 2
    COLUMN_FOOT = 4
    COLUMN_IMPULSE = 6
    COLUMN_RIGHT = 10
    COLUMNS = 11
    APART = 0
    STICKS = 1
    SLIDES_ON = 2
    SLIDES_BACK = 3
    STATES = 4
    ARMS = 4

@cython.final
cdef class ContactEquations:
    cdef public double[110] matrix
    cdef public double[10] solution
    cdef public double[36] mass
    cdef public double[6] right
    cdef public double[8] arm
    cdef public double[4] target
    cdef public double[2] follow, rolling, motor
    cdef public double[4] brush
    cdef public double[8] place, rate, acceleration, first_place, first_rate, place_sum, rate_sum
    cdef public bint[2] massless, moving, at_floor
    cdef public bint[8] allowed
    cdef public long long[2] state
    cdef public double mu, total_mass
    cpdef int begin(self, Leg outer, Leg inner, double total_mass, double hip_rotor, double mu) except -1
    cpdef void allow_all(self, long long side) noexcept
    cpdef void allow_only(self, long long side, long long state) noexcept
    cpdef void leave_out(self, long long side) noexcept
    cpdef bint solve(self, long long outer, long long inner) noexcept
    cdef void write_contact(self, long long side, long long state) noexcept
    cpdef double contact_rate(self, long long side, long long along) noexcept
    cpdef double slack(self, long long side, long long state) noexcept
    cpdef double settle(self, long long last) except? -1

cdef bint eliminate(double *a, double *x, long long n) noexcept
