cimport cython

from ranger_sim.firmware_sim.board cimport Board
from ranger_sim.foundation.row_stream cimport RowStream
from ranger_sim.plant.plant cimport Plant

@cython.final
cdef class Sampler:
    cdef public Plant plant
    cdef public Board board
    cdef public RowStream samples, words
    cdef public long long next_ns, columns
    cdef public double[::1] row
    cpdef int take(self, long long now) except -1
