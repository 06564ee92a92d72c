cimport cython

from libc.math cimport exp, log, sin
from ranger_sim.plant.mechanics.friction cimport smoothed_sign
from ranger_sim.plant.electrics.drive cimport Drive

@cython.final
cdef class MotorUnit:
    # what every step looks at stands first, beside each other
    cdef public Drive drive
    cdef public double mounting, gear, K, angle_factor, winding_ohm, series_ohm, contact_drop_V, dead_time_fraction
    cdef public double bridge_current_A, known_s, known_ohm, per_s, per_ohm, decay, decay_s, decay_squared_s
    cdef public double gate_W_per_V, ripple_per_ohm2, mu, C0
    # what a step leaves behind
    cdef public double heat_s, size_As, square_A2s, mechanical_J, drawn_J, returned_J, ripple_J, gate_J
    cdef public double current_A, battery_current_A, drive_Nm, coulomb_Nm, viscous_Nms
    # the rest is looked at every few steps, or by the body alone
    cdef public double tau_s, diode_drop_V, diode_J, total_As, from_battery_As
    cdef public bint heat_matters
    cdef public double inductance_H, C1, inverse_smoothing
    cdef public double resistance_per_K, torque_constant_per_K, G_wh, G_ha, inverse_C_w, inverse_C_h
    cdef public double air_C, rotor_temperature_C, housing_temperature_C, heat_W
    cdef public double drawn_before_J, warmed_As, warmed_A2s, warmed_J, warmed_ripple_J
    cdef public double[::1] ripples
    cdef public str name
    cdef public object parameters
    cpdef double magnetic_J(self) noexcept
    cpdef double battery_J(self) noexcept
    cpdef void turn(self, double angle_rad, double rate_rad_s, double seconds) noexcept
    cpdef double torque_Nm(self, double current_A, double rate_rad_s) noexcept
    cpdef void load(self, double current_A) noexcept
    cpdef void step_electrical(self, long long t0, long long t1, double rate_rad_s, double battery_V) noexcept
    cdef void _step_in_pieces(self, long long t0, long long t1, double back_emf_V, double battery_V) noexcept
    cdef void _heat(self) noexcept
    cdef void _know_step(self, double h, double R) noexcept
    cpdef void _warm(self, double h) noexcept
