cimport cython

from ranger_sim.firmware_sim.board cimport Board
from ranger_sim.plant.ranger cimport RangerPlant

@cython.final
cdef class StrikeWatch:
    cdef public RangerPlant plant
    cdef public Board board
    cdef public long long swing_leg, seen_ns, steps_noticed
    cdef public long long count, unmatched, missed
    cdef public double sum_ms, squares_ms2
    cpdef int look(self) except -1
    cdef void _notice(self) noexcept
