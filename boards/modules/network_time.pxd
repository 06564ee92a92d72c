from ranger_sim.boards.modules.receiver cimport Receiver

cdef class NetworkTime(Receiver):
    cdef public long long ms
