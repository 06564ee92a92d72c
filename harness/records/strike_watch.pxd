cimport cython

from ranger_sim.firmware_sim.board cimport Board
from ranger_sim.harness.step_watch cimport StepEnd
from ranger_sim.plant.ranger cimport RangerPlant

@cython.final
cdef class StrikeWatch(StepEnd):
    cdef public RangerPlant plant
    cdef public Board board
    cdef public long long swing_leg, seen_ns, steps_noticed
    cdef public long long count, unmatched, missed
    cdef public double sum_ms, squares_ms2
    cdef void _notice(self) noexcept
