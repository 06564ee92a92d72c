cimport cython

from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.foundation.row_stream cimport RowStream
from ranger_sim.harness.step_watch cimport StepWatch

@cython.final
cdef class ErrorWatch(StepWatch):
    cdef public list boards
    cdef public long long codes, count
    cdef public long long[::1] before
    cdef public RowStream rows
