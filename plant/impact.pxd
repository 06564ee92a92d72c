from libc.math cimport cos, fabs, sin
from ranger_sim.plant.body cimport Body

cdef int touch(Body body, long long foot) except -1
cdef void set_down(Body body, long long foot) noexcept
cdef int land(Body body, long long foot) except -1
cdef int close_linkage(Body body, long long foot) except -1
cpdef int impact(Body body, bint outer, bint inner) except -1
cdef int write_momentum(Body body) except -1
cdef void write_foot_at_rest(Body body, long long foot, long long row) noexcept
cdef void write_foot_with_motor(Body body, long long foot) noexcept
cdef void eliminate(Body body, long long n) noexcept
