from ranger_sim.foundation.row_stream cimport RowStream

cimport cython

@cython.final
cdef class Recorder:
    cdef public list frames
    cdef public RowStream samples, words
