from ranger_sim.firmware_sim.scheduler cimport call

cimport cython

@cython.final
cdef class State:
    cdef public long long number
    cdef public str name
    cdef public object entry, main, exit
    cdef public list machines, transitions
    cpdef int run_main(self) except -1

@cython.final
cdef class Transition:
    cdef public State target
    cdef public object condition

@cython.final
cdef class StateMachine:
    cdef public str name
    cdef public list states
    cdef public object on_change
    cdef public long long changes
    cdef public State start, current, told
    cdef public bint entered
    cpdef object put(self, name)
    cpdef object _tell(self)
    cpdef int step(self) except -1
