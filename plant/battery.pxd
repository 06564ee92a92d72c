cimport cython

from libc.math cimport sqrt

@cython.final
cdef class Battery:
    cdef public object parameters
    cdef public double[::1] curve
    cdef public long long intervals
    cdef public double resistance_ohm, per_As, charge, current_A, open_voltage_V, voltage_V, delivered_J, lost_J
    cdef public bint cut_off
    cpdef double open_circuit_V(self, double charge) noexcept
    cpdef void step(self, double h, double motor_current_A, double electronics_W) noexcept
