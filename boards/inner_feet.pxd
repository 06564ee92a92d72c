from ranger_sim.boards.ankle_board cimport AnkleBoard

cdef class InnerFeetBoard(AnkleBoard):
    pass
