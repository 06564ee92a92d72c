cimport cython

cdef extern from "Python.h":
    ctypedef struct PyObject
    ctypedef object (*plain_call "PyCFunction")(PyObject*, PyObject*)
    ctypedef object (*fast_call "_PyCFunctionFastWithKeywords")(PyObject*, PyObject**, Py_ssize_t, PyObject*)
    bint PyCFunction_CheckExact(object)
    plain_call PyCFunction_GET_FUNCTION(object)
    PyObject* PyCFunction_GET_SELF(object)
    int PyCFunction_GET_FLAGS(object)
    int METH_NOARGS, METH_FASTCALL, METH_KEYWORDS

# What stands in a schedule is mostly a bound method of a compiled class. Its C function is then called without the
# general machinery of Python calls; anything else is called in the ordinary way. (Cython declares methods without
# arguments as METH_NOARGS or, so that keywords can be refused, as METH_FASTCALL | METH_KEYWORDS.)
cdef inline object call(object function):
    if PyCFunction_CheckExact(function):
        if PyCFunction_GET_FLAGS(function) == METH_FASTCALL | METH_KEYWORDS:
            return (<fast_call>PyCFunction_GET_FUNCTION(function))(PyCFunction_GET_SELF(function), NULL, 0, NULL)
        if PyCFunction_GET_FLAGS(function) == METH_NOARGS:
            return PyCFunction_GET_FUNCTION(function)(PyCFunction_GET_SELF(function), NULL)
    return function()

cdef inline object call_with(object function, object argument):
    cdef PyObject* arguments
    if PyCFunction_CheckExact(function) and PyCFunction_GET_FLAGS(function) == METH_FASTCALL | METH_KEYWORDS:
        arguments = <PyObject*>argument
        return (<fast_call>PyCFunction_GET_FUNCTION(function))(PyCFunction_GET_SELF(function), &arguments, 1, NULL)
    return function(argument)

cdef class Task:
    cdef public object function
    cdef public long long cost, per_item, limit, kind
    cdef public str name, item
    cdef public long long calls, hits, last_cycles, max_cycles, total_cycles

@cython.final
cdef class Wait(Task):
    cdef public long long waits

@cython.final
cdef class Occasional(Task):
    cdef public list tasks
    cdef public long long position
    cdef public bint extra_idle_call
    cpdef Task next_task(self)

@cython.final
cdef class Schedule:
    cdef public long long slot_ns, divider, tick_cost, tick_slot, tick_latency
    cdef public list every, rows, last
    cdef public bint completion_flag

@cython.final
cdef class SlotRecord:
    cdef public long long time_ns, row, cycles
    cdef public bint overrun
    cdef public list tasks
    cdef public dict interrupts

@cython.final
cdef class SlotScheduler:
    cdef public Schedule schedule
    cdef public list tasks, row_starts, row_ends
    cdef public long long row_count, row, position, end, divider_count, slot_ns
    cdef public bint done, started
    cdef public long long slot_time, tick_time, finished_time
    cdef public long long slot_count, overruns, dropped_tasks, listed_tasks, run_tasks
    cdef public long long slot_cycles, near_limit_cycles, last_slot_cycles, max_slot_cycles, total_slot_cycles
    cdef public long long near_limits
    cdef public long long[::1] histogram
    cdef public long long histogram_step
    cdef public bint late
    cdef public long long late_time
    cdef public bint recording
    cdef public long long record_length
    cdef public list records
    cdef public SlotRecord record, late_record
    cpdef bint tick(self, long long timer_time) except? -1
    cpdef bint close(self, long long cycles) except? -1
