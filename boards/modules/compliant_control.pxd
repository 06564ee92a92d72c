from ranger_sim.boards.modules.receiver cimport Receiver
from ranger_sim.foundation.numbers cimport fixed_multiply, fixed_of_float, float_of_word

cimport cython

@cython.final
cdef class CompliantControl:
    cdef public long long sign
    cdef public bint latch_with_current
    cdef public long long command, stiffness, dampness, received_stiffness, received_dampness, target
    cpdef void set_command(self, long long current) noexcept
    cpdef void set_stiffness(self, long long gain) noexcept
    cpdef void set_dampness(self, long long gain) noexcept
    cpdef long long update(self, long long position, long long velocity) noexcept

@cython.final
cdef class GainReceiver(Receiver):
    cdef public CompliantControl control
    cdef public long long what
