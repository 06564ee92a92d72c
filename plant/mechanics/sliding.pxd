from libc.math cimport cos, sin
from ranger_sim.plant.mechanics.body cimport DOUBLE, SINGLE, Body
from ranger_sim.plant.mechanics.contact_equations cimport (
    APART, ARMS, COLUMN_FOOT, COLUMN_IMPULSE, COLUMN_LEG, COLUMN_VX, COLUMN_VY, SLIDES_BACK, SLIDES_ON, STICKS,
    ContactEquations,
)
from ranger_sim.plant.mechanics.friction cimport smoothed_sign
from ranger_sim.plant.mechanics.leg cimport INNER, OUTER, Leg
from ranger_sim.plant.mechanics.parts cimport Ankle, HipJoint
from ranger_sim.plant.mechanics.term_torques cimport TermTorques

cpdef enum:
    MOTOR = 6
    FREEDOMS = 8

cpdef void slide(Body body, double h, long long stages) noexcept
cdef void accelerate(Body body) noexcept
cpdef void write_forces(Body body) noexcept
cdef void write_leg(Body body, Leg leg) noexcept
cdef void write_brush(Body body, Leg leg) noexcept
cdef void write_press(Body body, Leg leg) noexcept
cdef void push(Body body, Leg leg, double along, double normal) noexcept
cdef void write_targets(Body body, Leg leg) noexcept
cdef void take_forces(Body body) noexcept
cdef long long state_of(Body body, Leg leg) noexcept
cdef void read_state(Body body) noexcept
cdef void write_state(Body body, double *q, double *u) noexcept
