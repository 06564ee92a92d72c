from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.datatable.store cimport DataStore

cimport cython

@cython.final
cdef class ErrorRing:
    cdef public long long size, dropped
    cdef public dict waiting
    cpdef int add(self, long long board, long long code, long long count, long long stamp) except -1
    cpdef object take(self)

@cython.final
cdef class ErrorDistribution:
    cdef public DataStore store
    cdef public ErrorModule errors
    cdef public bint inverted
    cdef public list source_ids
    cdef public long long id_own, id_computer, id_display
    cdef public ErrorRing computer, display
    cdef public long long computer_time_ms
    cdef public dict totals
