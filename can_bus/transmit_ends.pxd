from ranger_sim.foundation.events cimport NEVER

cimport cython

@cython.final
cdef class TransmitEnds:
    cdef public long long[4] times, statuses
    cdef public long long order
    cpdef bint write(self, long long buffer, long long time, long long status) noexcept
