cimport cython

from libc.math cimport cos, sin
from ranger_sim.plant.mechanics.contact_equations cimport ContactEquations
from ranger_sim.plant.mechanics.leg cimport INNER, OUTER, Leg
from ranger_sim.plant.mechanics.observed cimport Observed
from ranger_sim.plant.mechanics.parts cimport Ankle, HipJoint, Sole
from ranger_sim.plant.mechanics.term_torques cimport TermTorques

cpdef enum:
    HELD = 0
    SINGLE = 1
    DOUBLE = 2
    FLIGHT = 3
    FALLEN = 4

@cython.final
cdef class Body:
    # what every step looks at stands first, beside each other
    cdef public Leg outer, inner, stance, swing
    cdef public long long mode, step_start_ns, changes
    cdef public double hip_x, hip_y, hip_vx, hip_vy
    cdef public HipJoint hip
    cdef public Ankle ankle
    cdef public bint brush, standing, lock_hip
    cdef public TermTorques terms
    cdef public double M, gx, gy, inverse_smoothing
    cdef public double elapsed, time_s, strike_ahead
    cdef public Observed seen
    cdef public Leg last_strike
    cdef public double[4] saved
    # the rest serves double stance, the sole, events and additional terms
    cdef public double closing_rate, hip_ay
    cdef public Sole sole
    cdef public long long event
    cdef public Leg event_leg
    cdef public bint coulomb, compliant, floating, sliding, watched, unilateral, lift_leading
    cdef public ContactEquations equations
    cdef public object parameters, floor, record
    cdef public str cause
    cpdef void set_slope(self, double slope_rad) noexcept
    cpdef void stand_on(self, Leg leg) noexcept
    cpdef Leg other(self, Leg leg)
    cpdef Leg leg(self, long long side)
    cpdef double ahead(self) noexcept
    cpdef void anchor_foot(self, Leg leg) noexcept
    cpdef double contact_x(self, Leg leg) noexcept
    cpdef double slip_m_per_s(self, Leg leg) noexcept
    cpdef double hip_angle(self) noexcept
    cpdef double hip_rate(self) noexcept
    cpdef bint stands(self, Leg leg) noexcept
    cdef void know_angles(self) noexcept
    cpdef void update_pose(self) noexcept
    cpdef void update_hip_rates(self) noexcept
    cpdef void lift(self) noexcept
    cpdef dict snapshot(self)
    cpdef double energy_J(self)
    cpdef long long event_time_ns(self) noexcept
    cdef void save(self) noexcept
    cdef void restore(self) noexcept
