from firmware_sim.scheduler cimport call

cdef class State:
    cdef public long long number
    cdef public str name
    cdef public object entry, main, exit
    cdef public list machines, transitions
    cpdef object run_main(self)

cdef class Transition:
    cdef public State target
    cdef public object condition

cdef class StateMachine:
    cdef public str name
    cdef public list states
    cdef public object on_change
    cdef public long long changes
    cdef public State start, current
    cdef public bint entered
    cpdef object state_names(self)
    cpdef object put(self, name)
    cpdef object _tell(self)
    cpdef object step(self)
