from ranger_sim.boards.ankle_board cimport AnkleBoard
from ranger_sim.firmware_sim.scheduler cimport Schedule

cdef class InnerFeetBoard(AnkleBoard):
    cpdef Schedule schedule(self)
