from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.boards.modules.sender cimport Sender
from ranger_sim.firmware_sim.scheduler cimport call
from ranger_sim.foundation.numbers cimport word_of_float, word_of_i32

cimport cython

@cython.final
cdef class Publication:
    cdef public Sender sender
    cdef public long long identifier
    cdef public object function
    cdef public double constant
    cdef public bint whole

@cython.final
cdef class ErrorPublication:
    cdef public Sender sender
    cdef public long long identifier
    cdef public ErrorModule errors
