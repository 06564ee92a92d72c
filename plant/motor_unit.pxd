cimport cython

from libc.math cimport exp, log, tanh
from plant.drive cimport Drive

@cython.final
cdef class MotorUnit:
    cdef public str name
    cdef public object parameters
    cdef public Drive drive
    cdef public double mounting
    cdef public double gear, contact_drop_V, winding_ohm, series_ohm, K, inductance_H, ripple_per_ohm2, gate_W_per_V
    cdef public double diode_drop_V, dead_time_fraction, mu, C0, C1, inverse_smoothing
    cdef public double resistance_per_K, torque_constant_per_K, G_wh, G_ha, inverse_C_w, inverse_C_h
    cdef public bint heat_matters
    cdef public double air_C, rotor_temperature_C, housing_temperature_C
    cdef public double bridge_current_A, current_A, battery_current_A, heat_W
    cdef public double drive_Nm, coulomb_Nm, viscous_Nms
    cdef public double drawn_J, drawn_before_J, returned_J, mechanical_J, ripple_J, gate_J, diode_J
    cdef public double heat_s, size_As, square_A2s, warmed_As, warmed_A2s, warmed_J, warmed_ripple_J, known_s, known_ohm, tau_s, decay, decay_s, decay_squared_s
    cpdef double magnetic_J(self) noexcept
    cpdef double battery_J(self) noexcept
    cpdef double torque_Nm(self, double current_A, double rate_rad_s) noexcept
    cpdef void load(self, double current_A) noexcept
    cpdef void step_electrical(self, long long t0, long long t1, double rate_rad_s, double battery_V) noexcept
    cdef void _heat(self) noexcept
    cdef void _know_step(self, double h, double R) noexcept
    cpdef void _warm(self, double h) noexcept
