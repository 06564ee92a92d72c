from boards.ankle_board cimport AnkleBoard
from firmware_sim.scheduler cimport Schedule

cdef class InnerFeetBoard(AnkleBoard):
    cpdef Schedule schedule(self)
