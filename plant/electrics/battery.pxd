cimport cython

from libc.math cimport sqrt

@cython.final
cdef class Battery:
    cdef public double voltage_V, current_A, open_voltage_V, resistance_ohm, per_As, charge, delivered_J, lost_J
    cdef public bint cut_off
    cdef public long long intervals
    cdef public double[::1] curve
    cdef public object parameters
    cpdef double open_circuit_V(self, double charge) noexcept
    cpdef void step(self, double h, double motor_current_A, double electronics_W) noexcept
