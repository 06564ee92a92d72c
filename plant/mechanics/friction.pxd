from libc.math cimport exp

cpdef double smoothed_sign(double x) noexcept
