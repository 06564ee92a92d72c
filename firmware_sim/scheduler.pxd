cimport cython

cdef extern from "Python.h":
    ctypedef struct PyObject
    ctypedef object (*plain_call "PyCFunction")(PyObject*, PyObject*)
    bint PyCFunction_CheckExact(object)
    plain_call PyCFunction_GET_FUNCTION(object)
    PyObject* PyCFunction_GET_SELF(object)
    int PyCFunction_GET_FLAGS(object)
    int METH_NOARGS

# What stands in a schedule is mostly a bound method of a compiled class. Its C function is then called without the
# general machinery of Python calls; anything else is called in the ordinary way. (With always_allow_keywords off, as
# setup.py has it, methods without arguments are METH_NOARGS and methods with one are METH_O.)
cdef inline object call(object function):
    if PyCFunction_CheckExact(function) and PyCFunction_GET_FLAGS(function) == METH_NOARGS:
        return PyCFunction_GET_FUNCTION(function)(PyCFunction_GET_SELF(function), NULL)
    return function()

# A table's places keep the addresses of C functions and of the objects they belong to (which `functions` keeps alive);
# code 0: not such a function.
cdef inline long long code_of(object function):
    if PyCFunction_CheckExact(function) and PyCFunction_GET_FLAGS(function) == METH_NOARGS:
        return <long long><void*>PyCFunction_GET_FUNCTION(function)
    return 0

cdef inline long long owner_of(object function):
    if PyCFunction_CheckExact(function):
        return <long long><void*>PyCFunction_GET_SELF(function)
    return 0

cdef inline object run(SlotScheduler scheduler, long long place):
    if scheduler.codes[place] != 0:
        return (<plain_call><void*>scheduler.codes[place])(<PyObject*><void*>scheduler.owners[place], NULL)
    return scheduler.functions[place]()

cdef class Task:
    cdef public object routine
    cdef public long long base_cycles, most_cycles, per_item, kind
    cdef public str name, item
    cdef public long long hits
    cdef public long long noted_calls, noted_cycles, noted_most, noted_last, noted_when
    cdef public SlotScheduler scheduler
    cdef public long long number
    cpdef long long note(self, long long cycles) except? -1
    cpdef long long usual_calls(self) except? -1

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
    cdef public list tasks, functions, row_starts, row_ends
    cdef public double ns_per_cycle
    cdef public long long[::1] usual_ns, usual_calls, numbers, codes, owners
    cdef public long long row_count, row, position, end, divider_count, slot_ns
    cdef public bint done, started
    cdef public long long slot_time, tick_time, finished_time
    cdef public long long slot_count, overruns, dropped_tasks, listed_tasks, run_before, row_start
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
