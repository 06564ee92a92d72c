cimport cython

from foundation.events cimport EventQueue

cdef extern from "Python.h":
    ctypedef struct PyObject
    ctypedef object (*plain_call "PyCFunction")(PyObject*, PyObject*)
    bint PyCFunction_CheckExact(object)
    plain_call PyCFunction_GET_FUNCTION(object)
    PyObject* PyCFunction_GET_SELF(object)
    int PyCFunction_GET_FLAGS(object)
    int METH_O

# As in scheduler.pxd: a handler that is a method of a compiled class is called by the address of its C function.
cdef inline long long code_of(object function):
    if PyCFunction_CheckExact(function) and PyCFunction_GET_FLAGS(function) == METH_O:
        return <long long><void*>PyCFunction_GET_FUNCTION(function)
    return 0

cdef inline long long owner_of(object function):
    if PyCFunction_CheckExact(function):
        return <long long><void*>PyCFunction_GET_SELF(function)
    return 0

cdef inline object handle(InterruptSource source, EventQueue queue):
    if source.code != 0:
        return (<plain_call><void*>source.code)(<PyObject*><void*>source.owner, <PyObject*>queue)
    return source.handler(queue)

@cython.final
cdef class InterruptSource:
    cdef public long long kind, index
    cdef public str name
    cdef public object handler
    cdef public long long code, owner
    cdef public long long cost, per_item, latency, slot, bit
    cdef public long long base_cycles, base_ns, latency_ns
    cdef public bint attached, pending, keeps_message
    cdef public long long requests, merged, served, total_cycles, max_cycles
    cdef public long long time, order, a, b, c, d, e, f
    cdef public object ref
    cpdef int keep_message(self, EventQueue queue) except -1
    cpdef int give_message(self, EventQueue queue) except -1

@cython.final
cdef class InterruptController:
    cdef public double ns_per_cycle
    cdef public dict sources
    cdef public list fiq_list, irq_list
    cdef public long long pending
    cdef public InterruptSource newest
    cpdef InterruptSource source(self, long long kind, long long index)
    cpdef InterruptSource first_pending(self)
    cpdef bint raise_source(self, InterruptSource source) noexcept
